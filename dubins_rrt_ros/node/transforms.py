"""Transforms as they come by topic: kept by tf2_ros where it is installed, else by a buffer of our own, if the messages are."""

from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from rclpy.clock import JumpHandle, JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time

from .conversions import nanoseconds, rigid_from
from .rigid import Rigid
from .transform_buffer import TransformBuffer, TransformUnknown

try:
    import tf2_ros
except ImportError:  # part of an installation of ROS, not of the packages for pip
    tf2_ros = None
try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

#: Quality of service of /tf, and of /tf_static, as tf2 has it.
TF = QoSProfile(depth=100)
TF_STATIC = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Transforms(Protocol):
    """The transforms that are known; any thread may ask for them."""

    def lookup(self, target: str, source: str, stamp: int | None) -> tuple[Rigid, int | None]:
        """Return the pose of a frame in another at a time, as `TransformBuffer.lookup` does."""


def transforms(node: Node) -> Transforms | None:
    """Return the transforms that a node hears of; None where neither tf2_ros nor tf2_msgs is installed."""
    if tf2_ros is not None:
        return Tf2Transforms(node)
    return None if TFMessage is None else OwnTransforms(node)


def _on_jump_back(node: Node, forget: Callable[[], None]) -> JumpHandle:
    """Have this called when the node's clock is set back, as a simulation does that begins again, while the handle is kept."""
    threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False)
    return node.get_clock().create_jump_callback(threshold, post_callback=lambda jump: forget())


class Tf2Transforms:
    """Keeps transforms by tf2_ros."""

    def __init__(self, node: Node):
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer, node)
        self._jumps = _on_jump_back(node, self._buffer.clear)  # which keeps the static ones

    def lookup(self, target: str, source: str, stamp: int | None) -> tuple[Rigid, int | None]:
        """Return the pose of a frame in another at a time."""
        try:
            found = self._buffer.lookup_transform(target, source, Time(nanoseconds=stamp or 0))
        except tf2_ros.TransformException as error:
            reason = " ".join(str(error).split()).rstrip(".")
            raise TransformUnknown(reason, is_final="into the past" in reason) from None
        pose = rigid_from(found.transform)
        if pose is None:
            raise TransformUnknown("it is no transform")
        return pose, Time.from_msg(found.header.stamp).nanoseconds or None


class OwnTransforms:
    """Keeps transforms by a buffer of our own."""

    def __init__(self, node: Node):
        self._buffer = TransformBuffer()
        self._jumps = _on_jump_back(node, self._buffer.forget_moving)
        node.create_subscription(TFMessage, "/tf", partial(self._take, is_static=False), TF)
        node.create_subscription(TFMessage, "/tf_static", partial(self._take, is_static=True), TF_STATIC)

    def _take(self, message: Any, is_static: bool) -> None:
        for transform in message.transforms:
            pose, parent, child = rigid_from(transform.transform), transform.header.frame_id, transform.child_frame_id
            if pose is not None and parent and child and parent != child:
                self._buffer.add(parent, child, nanoseconds(transform.header.stamp), pose, is_static)

    def lookup(self, target: str, source: str, stamp: int | None) -> tuple[Rigid, int | None]:
        """Return the pose of a frame in another at a time."""
        return self._buffer.lookup(target, source, stamp)
