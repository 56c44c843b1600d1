"""Transforms as they come by topic: kept by tf2_ros where it is installed, else by a buffer of our own, if the messages are.

They are taken when one is asked for, and once in a while: a robot sends hundreds a second, and each would wake the executor of
the node, which costs a millisecond.
"""

import contextlib
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from rclpy.clock import JumpHandle, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time

from dubins_rrt_ros.planning.text import quoted_name

from .conversions import nanoseconds, rigid_from
from .executor_queue import steady_timer
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

#: Time between two looks for transforms where none is asked for [s].
TAKE_INTERVAL = 0.2
#: Quality of service of /tf, which keeps what comes in that time, and of /tf_static, as tf2 has it.
TF = QoSProfile(depth=1000)
TF_STATIC = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Buffer(Protocol):
    """Keeps transforms that its node hears of."""

    def lookup(self, target: str, source: str, stamp: int | None) -> tuple[Rigid, int | None]:
        """Return the pose of a frame in another at a time, as `TransformBuffer.lookup` does."""

    def forget_moving(self) -> None:
        """Forget all but the static ones."""


def transforms(node: Node) -> "Transforms | None":
    """Return the transforms that a node hears of; None where neither tf2_ros nor tf2_msgs is installed."""
    if tf2_ros is not None:
        return Transforms(node, Tf2Buffer)
    return None if TFMessage is None else Transforms(node, OwnBuffer)


class Transforms:
    """The transforms that are known; any thread may ask for them."""

    def __init__(self, node: Node, make_buffer: Callable[[Node], Buffer]):
        # A node of its own, which no executor spins but when it is looked at; the rules for topics hold for it too.
        name = f"{node.get_name()}_transforms"
        self._listener = Node(name, namespace=node.get_namespace(), context=node.context, enable_rosout=False,
                              start_parameter_services=False, cli_args=["--ros-args", "-r", f"__node:={name}"])
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._listener)
        self._buffer, self._lock = make_buffer(self._listener), threading.Lock()
        # When the clock is set back, as by a simulation that begins again.
        threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False)
        self._jumps: JumpHandle = node.get_clock().create_jump_callback(threshold, post_callback=self._forget)
        steady_timer(node, TAKE_INTERVAL, self._take)

    def lookup(self, target: str, source: str, stamp: int | None) -> tuple[Rigid, int | None]:
        """Return the pose of a frame in another at a time, as `TransformBuffer.lookup` does."""
        self._take()
        return self._buffer.lookup(target, source, stamp)

    def _take(self) -> None:
        """Hand what has come to the buffer."""
        with self._lock:
            while self._takes_some():
                pass

    def _takes_some(self) -> bool:
        """Hand one message of each topic to the buffer, and return True if there was any: a round ends as if none had come."""
        found = False
        with contextlib.suppress(TimeoutException, ShutdownException, ExternalShutdownException):
            while True:
                take, _, _ = self._executor.wait_for_ready_callbacks(timeout_sec=0)
                found = True
                take()
                take.result()  # raises what it raised
        return found

    def _forget(self, jump: TimeJump) -> None:
        self._take()
        self._buffer.forget_moving()

    def close(self) -> None:
        """Hear no more."""
        with self._lock:
            self._executor.shutdown()
            self._listener.destroy_node()


class Tf2Buffer:
    """Keeps transforms by tf2_ros."""

    def __init__(self, listener: Node):
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer, listener, qos=TF)

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

    def forget_moving(self) -> None:
        """Forget all but the static ones, which tf2 keeps."""
        self._buffer.clear()


class OwnBuffer(TransformBuffer):
    """Keeps transforms by a buffer of our own."""

    def __init__(self, listener: Node):
        super().__init__()
        self._logger = listener.get_logger()
        listener.create_subscription(TFMessage, "/tf", partial(self._hear, is_static=False), TF)
        listener.create_subscription(TFMessage, "/tf_static", partial(self._hear, is_static=True), TF_STATIC)

    def _hear(self, message: Any, is_static: bool) -> None:
        for transform in message.transforms:
            # As tf2 does, which leaves out the slash that names had in ROS 1.
            parent, child = transform.header.frame_id.removeprefix("/"), transform.child_frame_id.removeprefix("/")
            pose = rigid_from(transform.transform)
            if pose is not None and parent and child and parent != child:
                self.add(parent, child, nanoseconds(transform.header.stamp), pose, is_static)
            else:
                self._logger.warning(f"A transform from {quoted_name(parent)} to {quoted_name(child)} is ignored: its numbers "
                                     "have to be finite, its quaternion normalised, and its frames two with names", once=True)
