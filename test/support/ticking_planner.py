"""The planner with a timer beside its own: `ticking_planner.py FILE --ros-args ...` writes when it ticked.

FILE gets a list of the ticks by the monotonic clock [s], which all processes share.
"""

import json
import sys
import time
from pathlib import Path

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from dubins_rrt_ros.node.interruption import Interruption
from dubins_rrt_ros.node.main import _spin
from dubins_rrt_ros.node.planner_node import PlannerNode

#: How often it should tick [s].
INTERVAL = 0.01


def main(file: str) -> None:
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node, executor = PlannerNode(), SingleThreadedExecutor()
    ticks = []
    node.create_timer(INTERVAL, lambda: ticks.append(time.monotonic()), clock=Clock(clock_type=ClockType.STEADY_TIME))
    executor.add_node(node)
    try:
        _spin(executor, node, Interruption())
    except KeyboardInterrupt:
        pass
    finally:
        Path(file).write_text(json.dumps(ticks))
        node.close()
        executor.shutdown()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main(sys.argv[1])
