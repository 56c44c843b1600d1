"""The topics on which the vehicle's pose comes."""

import time
from collections import deque
from collections.abc import Callable

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.node import Node

from dubins_rrt_ros.planning import Pose

from .executor_queue import steady_timer
from .frames import Frames
from .outcome import failures_reported
from .qos import VOLATILE
from .readiness import Readiness
from .request import NotYet

#: Time between two looks for the transform of a pose that waits for it [s], and maximum number of such poses.
LOOK_INTERVAL, MOST_WAITING = 0.02, 100


class StartTopics:
    """Takes starts; one whose transform is not there yet waits for it, and gives way to newer ones.

    Args:
        node, readiness, frames: the node's.
        on_start: called with each start that was taken.
    """

    def __init__(self, node: Node, readiness: Readiness, frames: Frames, on_start: Callable[[Pose], None]):
        self._node, self._readiness, self._frames, self._on_start = node, readiness, frames, on_start
        # With the time when each came.
        self._waiting: deque[tuple[PoseStamped | PoseWithCovarianceStamped, float]] = deque(maxlen=MOST_WAITING)
        self._timer = steady_timer(node, LOOK_INTERVAL, self._look)  # runs while some wait
        self._timer.cancel()
        node.create_subscription(PoseStamped, "start_pose", self._take, VOLATILE)
        node.create_subscription(PoseWithCovarianceStamped, "initialpose", self._take, VOLATILE)

    def _take(self, message: PoseStamped | PoseWithCovarianceStamped) -> None:
        if self._frames.follows_vehicle:
            self._node.get_logger().warning("Starts by topic are not taken: robot_base_frame is set", once=True)
            return
        self._waiting.append((message, time.monotonic()))
        self._look()

    def _look(self) -> None:
        """Take the newest start whose transform is known, and drop those before it."""
        for number in reversed(range(len(self._waiting))):
            with failures_reported(self._node, self._readiness.refuse_start):
                if not self._is_taken(*self._waiting[number]):
                    continue
            for _ in range(number + 1):
                self._waiting.popleft()
            break
        if self._waiting:
            self._timer.reset()
        else:
            self._timer.cancel()

    def _is_taken(self, message: PoseStamped | PoseWithCovarianceStamped, came: float) -> bool:
        """Take a start, and return True; False where its transform may still come."""
        try:
            start = self._frames.pose("start", message)
        except NotYet as missing:
            if time.monotonic() - came < missing.patience:
                return False
            raise missing.refusal() from None
        self._readiness.take_start(start)
        self._on_start(start)
        return True
