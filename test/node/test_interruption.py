"""Signals to the node's process: who takes them, and that it breaks nothing off."""

import subprocess
import sys

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

#: Makes the node as its command does.
CONFIGURED = """
import rclpy
from rclpy.signals import get_current_signal_handlers_options
from dubins_rrt_ros.node.main import _configured_node
node = _configured_node(["planner"])
print(get_current_signal_handlers_options().name)
node.close()
rclpy.shutdown()
"""
#: Has a signal come in the midst of a callback.
WITHIN = """
import os, signal
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from dubins_rrt_ros.node.interruption import Interruption
from dubins_rrt_ros.node.main import _spin

def call():
    os.kill(os.getpid(), signal.SIGTERM)
    print("the callback ended")

interruption = Interruption()
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
executor, node = SingleThreadedExecutor(), rclpy.create_node("any")
node.create_timer(0.001, call)
executor.add_node(node)
_spin(executor, node, interruption)
print("the node ended")
executor.shutdown()
rclpy.shutdown()
"""


@pytest.mark.slow
def test_rclpy_takes_no_signals_as_its_thread_uses_what_executors_that_end_have_freed():
    assert said(CONFIGURED).splitlines()[-1] == "NO"


def test_a_signal_does_not_break_off_a_callback():
    assert said(WITHIN) == "the callback ended\nthe node ended\n"


def said(script: str) -> str:
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout
