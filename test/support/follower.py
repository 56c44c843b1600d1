"""A small FollowPath server, a process of its own: `follower.py NAMESPACE drive|reject|abort|wait|late`.

It drives along the path a pose at a time, rejects the goal, aborts it half way, or waits until it is cancelled; late,
it takes its time to accept it, too.
"""

import math
import sys
import time
from itertools import pairwise

import rclpy
from nav2_msgs.action import FollowPath
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.clock import Clock, ClockType
from rclpy.task import Future


class Follower:
    """Follows paths in the way of the command line."""

    def __init__(self, node, way: str):
        self._way, self._node = way, node
        self._ticked = Future()
        node.create_timer(0.02, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._server = ActionServer(node, FollowPath, "follow_path", self._follow, goal_callback=self._on_goal,
                                    cancel_callback=lambda handle: CancelResponse.ACCEPT)

    def _tick(self):
        ticked, self._ticked = self._ticked, Future()
        ticked.set_result(None)

    def _on_goal(self, goal):
        if self._way == "late":
            time.sleep(0.5)
        usable = goal.path.poses and goal.controller_id == "FollowPath"
        return GoalResponse.ACCEPT if usable and self._way != "reject" else GoalResponse.REJECT

    async def _follow(self, handle):
        places = [(pose.pose.position.x, pose.pose.position.y) for pose in handle.request.path.poses]
        left = sum(map(math.dist, places, places[1:]))
        for number, (here, there) in enumerate(pairwise(places)):
            await self._ticked
            left -= math.dist(here, there)
            handle.publish_feedback(FollowPath.Feedback(distance_to_goal=left, speed=0.5))
            while self._way in ("wait", "late") and not handle.is_cancel_requested:
                await self._ticked
            if handle.is_cancel_requested:
                handle.canceled()
                return FollowPath.Result()
            if self._way == "abort" and number > len(places) // 2:
                handle.abort()
                return FollowPath.Result(error_code=FollowPath.Result.FAILED_TO_MAKE_PROGRESS, error_msg="it is stuck")
        handle.succeed()
        return FollowPath.Result()


def main(namespace: str, way: str) -> None:
    rclpy.init()
    node = rclpy.create_node("controller_server", namespace=namespace)
    follower = Follower(node, way)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        del follower


if __name__ == "__main__":
    main(*sys.argv[1:])
