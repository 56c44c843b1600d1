"""Transforms of poses to the global frame, by tf2 where it is installed."""

from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Transform
from rclpy.node import Node
from rclpy.time import Time

from dubins_rrt_ros.planning import InvalidPose, Status
from dubins_rrt_ros.planning.problem import Pose
from dubins_rrt_ros.planning.text import quoted_name

from .conversions import bare_pose, doubts_about, has_rotation, pose_from, transformed
from .request import Refusal

try:
    import tf2_ros
except ImportError:  # part of an installation of ROS, not of the packages for pip
    tf2_ros = None


class Frames:
    """Transforms stamped poses to the global frame, by the latest transform."""

    def __init__(self, node: Node, frame: str):
        self._logger = node.get_logger()
        self._frame = frame
        self._doubts: set[tuple[str, str]] = set()  # that were logged: the pose's name and the kind
        if tf2_ros is not None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer, node)

    def is_global(self, frame: str) -> bool:
        """Return True if poses in this frame need no transform."""
        return frame in ("", self._frame)

    def pose(self, name: str, message: PoseStamped | PoseWithCovarianceStamped, any_heading: bool = False) -> Pose:
        """Return the (x, y, yaw) of a message's pose in the global frame.

        Args:
            name: what the pose is, for messages.
            message: a pose in any frame.
            any_heading: True if its heading does not matter; then a quaternion of zeros is taken for no rotation.

        Raises:
            Refusal: it cannot be transformed, or is not a pose; `name` is in the message.
        """
        pose, frame = bare_pose(message), message.header.frame_id
        if any_heading and not has_rotation(pose):
            pose = PoseMessage(position=pose.position)  # whose w is 1
        if not frame:
            self._logger.warning(f"A {name} pose without frame_id is taken to be in '{self._frame}'", once=True)
        elif frame != self._frame:
            pose = transformed(pose, self._latest(name, frame))
        try:
            planar = pose_from(name, pose)
        except InvalidPose as error:
            raise Refusal(Status.INVALID_POSE, str(error)) from None
        self._warn_once(name, pose)
        return planar

    def _warn_once(self, name: str, pose: PoseMessage) -> None:
        """Log what is unusual about a pose that is taken: each kind once for starts, and once for goals."""
        for kind, doubt in doubts_about(name, pose).items():
            if (name, kind) not in self._doubts:
                self._doubts.add((name, kind))
                self._logger.warning(doubt)

    def _latest(self, name: str, frame: str) -> Transform:
        if frame.startswith("/"):
            raise self._refusal(name, frame, "tf2 knows no frames with a leading slash; leave it out, or", True)
        if tf2_ros is None:
            raise self._refusal(name, frame, "tf2_ros is not installed (ros-jazzy-tf2-ros-py); install it, or", True)
        try:
            return self._buffer.lookup_transform(self._frame, frame, Time()).transform
        except tf2_ros.TransformException as error:
            raise self._refusal(name, frame, f"{' '.join(str(error).split()).rstrip('.')}; publish that transform, or") from None

    def _refusal(self, name: str, frame: str, why: str, is_final: bool = False) -> Refusal:
        return Refusal(Status.TF_ERROR, f"The {name} pose is in frame {quoted_name(frame)} and cannot be transformed to "
                                        f"'{self._frame}': {why} publish the pose in '{self._frame}'.", is_final)
