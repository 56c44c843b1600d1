"""A client of Nav2's planner actions, which calls them as Nav2's own BasicNavigator does."""

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient

from support.harness import Client, stamped

SUCCEEDED, CANCELED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED


class PathClient:
    """A client of one action.

    Attributes:
        client: the process' other topics and services.
    """

    def __init__(self, client: Client, kind, name: str):
        self.client, self._kind = client, kind
        self._action = ActionClient(client.node, kind, name)
        client.wait_for(self._action.server_is_ready, f"the action {name}")

    def send(self, goal=None, start=None, goals=None, planner_id="", **more):
        """Send a goal to (x, y, yaw), or over several; the handle of it once it is accepted."""
        message = self._kind.Goal(planner_id=planner_id, use_start=start is not None, **more)
        if start is not None:
            message.start = stamped(start)
        if goals is None:
            message.goal = stamped(goal)
        else:
            message.goals = [stamped(pose) for pose in goals]
        return self.accepted(message)

    def accepted(self, message):
        """Send a goal as it is; the handle of it once it is accepted."""
        handle = self.handle(message)
        assert handle.accepted
        return handle

    def handle(self, message):
        """Send a goal as it is; the handle of it, accepted or not."""
        return self.answer(self._action.send_goal_async(message))

    def result(self, handle):
        """How a goal ended, and its result."""
        response = self.answer(handle.get_result_async())
        return response.status, response.result

    def path(self, *args, **fields):
        """Send a goal and wait for how it ended, and its result."""
        return self.result(self.send(*args, **fields))

    def cancel(self, handle) -> list:
        """Cancel a goal; the goals that are being cancelled now."""
        return self.answer(handle.cancel_goal_async()).goals_canceling

    def answer(self, future):
        """Wait for what the server answers."""
        self.client.wait_for(future.done, "an answer of the action server")
        return future.result()
