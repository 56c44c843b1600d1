"""Nav2's service is_path_valid: is the outline clear of obstacles along the poses of a path?"""

from concurrent.futures import Future as WorldFuture
from functools import partial
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from dubins_rrt_ros.planning import InvalidPose, Pose, Vehicle, World
from dubins_rrt_ros.planning.collision.poses import blocked_poses, nearest_pose
from dubins_rrt_ros.planning.text import quoted_name

from .conversions import filled, path_poses
from .dispatcher import Dispatcher
from .executor_queue import ExecutorQueue
from .maps import Maps
from .outcome import outcome_of
from .parameters import Parameters
from .qos import SERVICE
from .readiness import Readiness


class PathValidity:
    """Answers is_path_valid, in a worker of its own: a search under way does not keep it waiting."""

    def __init__(self, node: Node, kind: Any, parameters: Parameters, maps: Maps, readiness: Readiness, dispatcher: Dispatcher,
                 queue: ExecutorQueue, group: CallbackGroup):
        self._node, self._parameters, self._maps, self._readiness, self._queue = node, parameters, maps, readiness, queue
        self._worker = dispatcher.new_worker("is_path_valid")
        node.create_service(kind, "is_path_valid", self._on_request, qos_profile=SERVICE, callback_group=group)

    async def _on_request(self, request: Any, response: Any) -> Any:
        try:
            self._check(request.path)
            found = await self._judged(request.path)
            if isinstance(found, Exception):
                raise found
        except Exception as error:  # of any kind: a client waits for the answer
            self._node.get_logger().warning(f"is_path_valid answers false: {outcome_of(error, self._node).message}")
            return filled(response, is_valid=False, success=False)
        return filled(response, is_valid=not found, success=True, invalid_pose_indices=found)

    def _check(self, path: Any) -> None:
        frame = self._parameters.read().node.global_frame
        self._readiness.require_map()
        if not path.poses:
            raise InvalidPose("The path is empty; give its poses.")
        for header in (path.header, *(pose.header for pose in path.poses)):  # where the path has no frame, its poses may
            if header.frame_id not in ("", frame):
                raise InvalidPose(f"The path is in frame {quoted_name(header.frame_id)}; give it in '{frame}'.")

    def _judged(self, path: Any) -> Future:
        """Return a future of the indices of poses that are not valid, or of what was raised."""
        found = Future()
        self._worker.submit(partial(_judge, path, self._readiness.known_start(), self._parameters.read().vehicle,
                                    self._maps.world_for_request()),
                            lambda outcome: self._queue.post(partial(found.set_result, outcome)))
        return found


def _judge(path: Any, start: Pose | None, vehicle: Vehicle, world: "WorldFuture[World]", cancelled: Any) -> list[int]:
    poses = path_poses(path)
    first = 0 if start is None else nearest_pose(poses, start)
    found = blocked_poses(world.result().for_vehicle(vehicle).field, vehicle, poses[first:])
    return [first + index for index in found]
