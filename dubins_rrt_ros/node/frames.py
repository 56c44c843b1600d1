"""Poses in the global frame: those of messages, and the vehicle's by its transform."""

from typing import NamedTuple

from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.node import Node

from dubins_rrt_ros.planning import InvalidPose, Status
from dubins_rrt_ros.planning.problem import Pose, Waypoint
from dubins_rrt_ros.planning.text import quoted_name

from .conversions import bare_pose, doubts_about, has_rotation, nanoseconds, pose_from, transformed
from .parameters import Parameters
from .request import NotYet, Refusal
from .rigid import Rigid
from .transform_buffer import TransformUnknown
from .transforms import transforms

#: What to install for transforms.
REMEDY = "neither tf2_ros nor tf2_msgs is installed (ros-jazzy-tf2-ros-py)"


class _Source(NamedTuple):
    """A frame from which a pose is to be transformed.

    Attributes:
        frame: its name.
        subject: what is in it, as the subject of a sentence, with the frame's name.
        alternative: what to do other than to provide the transform.
    """

    frame: str
    subject: str
    alternative: str


class Frames:
    """Transforms stamped poses to the global frame, each at its stamp, and knows where the vehicle's frame is."""

    def __init__(self, node: Node, parameters: Parameters, frame: str):
        self._logger, self._clock = node.get_logger(), node.get_clock()
        self._parameters, self._frame = parameters, frame
        self._doubts: set[tuple[str, str]] = set()  # that were logged: the pose's name and the kind
        self._transforms = transforms(node)

    def close(self) -> None:
        """Hear no more transforms."""
        if self._transforms is not None:
            self._transforms.close()

    @property
    def follows_vehicle(self) -> bool:
        """True if the vehicle's pose is that of a frame."""
        return bool(self._parameters.read().node.robot_base_frame)

    def is_global(self, frame: str) -> bool:
        """Return True if poses in this frame need no transform."""
        return frame in ("", self._frame)

    def pose(self, name: str, message: PoseStamped | PoseWithCovarianceStamped, any_heading: bool = False) -> Pose:
        """Return the (x, y, yaw) of a message's pose in the global frame; any thread may ask for it.

        Args:
            name: what the pose is, for messages.
            message: a pose in any frame; it is transformed at its stamp, at the latest time where that is 0.
            any_heading: True if its heading does not matter; then a quaternion of zeros is taken for no rotation.

        Raises:
            NotYet: its transform is not known yet.
            Refusal: it cannot be transformed, or is not a pose; `name` is in the message.
        """
        pose, frame = bare_pose(message), message.header.frame_id
        if any_heading and not has_rotation(pose):
            pose = PoseMessage(position=pose.position)  # whose w is 1
        if not frame:
            self._logger.warning(f"A {name} pose without frame_id is taken to be in '{self._frame}'", once=True)
        elif frame != self._frame:
            source = _Source(frame, f"The {name} pose is in frame {quoted_name(frame)}", f"publish the pose in '{self._frame}'")
            pose = transformed(pose, self._lookup(source, nanoseconds(message.header.stamp) or None)[0])
        try:
            planar = pose_from(name, pose)
        except InvalidPose as error:
            raise Refusal(Status.INVALID_POSE, str(error)) from None
        self._warn_once(name, pose)
        return planar

    def waypoint(self, name: str, message: PoseStamped) -> Waypoint:
        """Return the same of a pose on the way, whose yaw is None where its quaternion is all zero: any heading will do."""
        x, y, yaw = self.pose(name, message, any_heading=True)
        return x, y, yaw if has_rotation(message.pose) else None

    def vehicle(self) -> Pose:
        """Return the (x, y, yaw) of the vehicle's frame at the latest time; any thread may ask for it.

        Raises:
            NotYet: its transform is not known yet, or too old.
            Refusal: transforms are not known at all, or it is no pose in the plane.
        """
        options = self._parameters.read().node
        source = _Source(options.robot_base_frame, f"The start is the vehicle's frame {quoted_name(options.robot_base_frame)}",
                         "leave robot_base_frame empty and publish start_pose")
        found, stamp = self._lookup(source, None)
        if stamp is not None and (age := (self._clock.now().nanoseconds - stamp) / 1e9) > options.transform_max_age:
            raise self._not_yet(source, f"the latest transform is {age:.1f} s old, more than transform_max_age "
                                        f"({options.transform_max_age:g} s); publish it more often, raise transform_max_age")
        try:
            return pose_from("start", transformed(PoseMessage(), found))
        except InvalidPose as error:
            raise Refusal(Status.INVALID_POSE, str(error)) from None

    def _warn_once(self, name: str, pose: PoseMessage) -> None:
        """Log what is unusual about a pose that is taken: each kind once for starts, and once for goals."""
        for kind, doubt in doubts_about(name, pose).items():
            if (name, kind) not in self._doubts:
                self._doubts.add((name, kind))
                self._logger.warning(doubt)

    def _lookup(self, source: _Source, stamp: int | None) -> tuple[Rigid, int | None]:
        if source.frame.startswith("/"):
            raise self._refusal(source, "tf2 knows no frames with a leading slash; leave it out")
        if self._transforms is None:
            raise self._refusal(source, f"{REMEDY}; install one")
        try:
            return self._transforms.lookup(self._frame, source.frame, stamp)
        except TransformUnknown as error:
            if error.is_final and stamp is not None:  # the latest may always come
                raise self._refusal(source, f"{error}; send it sooner") from None
            raise self._not_yet(source, f"{error}; {error.remedy}") from None

    def _not_yet(self, source: _Source, why: str) -> NotYet:
        refusal = self._refusal(source, why, is_final=False)
        return NotYet("a transform", self._parameters.read().node.transform_tolerance, lambda: refusal)

    def _refusal(self, source: _Source, why: str, is_final: bool = True) -> Refusal:
        return Refusal(Status.TF_ERROR, f"{source.subject} and cannot be transformed to '{self._frame}': {why}, or "
                                        f"{source.alternative}.", is_final)
