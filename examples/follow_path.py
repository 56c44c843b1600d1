"""Plan to a goal and have Nav2's controller drive there: follow_path.py X Y YAW. Ctrl-C stops the robot."""

import math
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav2_msgs.action import ComputePathToPose, FollowPath
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Header

#: Set by Ctrl-C. An exception could come between a goal that was sent and the answer by which it is cancelled.
INTERRUPTED = threading.Event()


class Failure(Exception):
    """An action that did not succeed; the message says why."""


class Action:
    """An action of Nav2, called and waited for."""

    def __init__(self, node: Node, kind: Any, name: str):
        self._node, self._name, self._client = node, name, ActionClient(node, kind, name)

    def result(self, goal: Any, on_feedback: Any = None) -> Any:
        """Return the result of a goal, which Ctrl-C cancels.

        Raises:
            Failure: no server is there, or it rejected, aborted or cancelled the goal.
        """
        if not self._client.wait_for_server(timeout_sec=10.0):
            raise Failure(f"nobody serves {self._name}")
        if INTERRUPTED.is_set():
            raise Failure(f"{self._name} was cancelled")
        handle = self._answer(self._client.send_goal_async(goal, feedback_callback=on_feedback))
        if not handle.accepted:
            raise Failure(f"{self._name} rejected the goal")
        ended = handle.get_result_async()
        self._spin(lambda: ended.done() or INTERRUPTED.is_set())
        if not ended.done():
            self._answer(handle.cancel_goal_async())
        response = self._answer(ended)
        if response.status == GoalStatus.STATUS_CANCELED:
            raise Failure(f"{self._name} was cancelled")
        if response.status != GoalStatus.STATUS_SUCCEEDED:
            raise Failure(f"{self._name} failed, {response.result.error_code}: {response.result.error_msg}")
        return response.result

    def _answer(self, future: Any) -> Any:
        self._spin(future.done)
        return future.result()

    def _spin(self, is_over: Callable[[], bool]) -> None:
        while not is_over():
            rclpy.spin_once(self._node, timeout_sec=0.1)


def drive(node: Node, x: float, y: float, yaw: float) -> None:
    """Plan from where the vehicle is, and follow the path."""
    rotation = Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    goal = PoseStamped(header=Header(frame_id="map"), pose=Pose(position=Point(x=x, y=y), orientation=rotation))
    planned = Action(node, ComputePathToPose, "compute_path_to_pose").result(ComputePathToPose.Goal(goal=goal, use_start=False))
    print(planned.error_msg, flush=True)
    follow = Action(node, FollowPath, "follow_path")
    follow.result(FollowPath.Goal(path=planned.path, controller_id="FollowPath"),
                  lambda message: print(f"{message.feedback.distance_to_goal:.2f} m to go", flush=True))
    print("arrived", flush=True)


def interrupt(*_: Any) -> None:
    """Have the goal cancelled; the next Ctrl-C ends the program whoever does not answer."""
    INTERRUPTED.set()
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def main() -> int:
    """Drive to the goal of the command line; return the exit status."""
    goal = map(float, remove_ros_args(sys.argv)[1:])
    # Ctrl-C is ours: the goal is to be cancelled first, for which ROS is needed.
    signal.signal(signal.SIGINT, interrupt)
    rclpy.init(args=sys.argv, signal_handler_options=rclpy.SignalHandlerOptions.NO)
    try:
        drive(rclpy.create_node("follow_path"), *goal)
    except Failure as failure:
        print(failure, file=sys.stderr)
        return 1
    finally:
        rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
