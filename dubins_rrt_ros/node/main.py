"""The node's process: arguments, signals, exit status."""

import argparse
import sys

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from dubins_rrt_ros.planning import MapError, OptionError
from dubins_rrt_ros.planning.text import one_line

from .interruption import Interruption
from .parameter_files import as_yaml, doubtful_rules, unused_files
from .parameter_table import as_table
from .parameters import AS_TEXT, OPTIONS
from .planner_node import PlannerNode

#: What to do about what ROS says of its arguments, the first that fits.
REMEDIES = {"Sequences cannot be key": f"; give a footprint {AS_TEXT}: footprint: \"[[x, y], ...]\"",
            "params file": "; give a file of parameters as planner --print-parameters prints one",
            "parameter override rule": "; give -p NAME:=VALUE, such as -p turning_radius:=2.0",
            "-p flag": "; give -p NAME:=VALUE, such as -p turning_radius:=2.0"}
#: Time after which a thread gives up Python's lock to another [s], in place of 5 ms: a path is published beside a search that
#: goes on, and each call of ROS gives up the lock.
SWITCH_INTERVAL = 2e-4


class ConfigurationError(Exception):
    """A configuration with which the node cannot start; the message, of one line, names what to change."""


def main(args: list[str] | None = None) -> int:
    """Run the node and return the exit status: 1 where its configuration cannot be used."""
    try:
        return _run(sys.argv if args is None else args, Interruption())
    except KeyboardInterrupt:
        return 0
    except ConfigurationError as error:
        print(f"planner: {error}", file=sys.stderr)
        return 1


def _run(arguments: list[str], interruption: Interruption) -> int:
    node = executor = None
    try:
        if printed := _parse(arguments).printed:
            print(printed(), end="")
            return 0
        sys.setswitchinterval(SWITCH_INTERVAL)
        node = _configured_node(arguments)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        _spin(executor, node, interruption)
    finally:
        interruption.ignore()
        if node is not None:
            node.close()
        if executor is not None:
            executor.shutdown()  # the garbage collector may take it after what it refers to, with a traceback
        rclpy.try_shutdown()
    return 0


def _spin(executor: SingleThreadedExecutor, node: PlannerNode, interruption: Interruption) -> None:
    with interruption.waking(executor):
        while not interruption.came:
            try:
                executor.spin_once()
            except Exception as error:  # of any kind: the node goes on
                node.report_defect(error)


def _configured_node(arguments: list[str]) -> PlannerNode:
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # a ROS argument or a parameter file that cannot be read
        raise _refused_by_ros(error) from error
    try:
        node = PlannerNode()
    except MapError as error:
        raise ConfigurationError(f"map_file: {error}") from error
    except (OptionError, NameValidationException, ParameterException) as error:
        raise ConfigurationError(one_line(str(error))) from error
    name = node.get_fully_qualified_name()
    for warning in (*unused_files(arguments, name), *doubtful_rules(arguments, name)):
        node.get_logger().warning(warning)
    return node


def _parse(arguments: list[str]) -> argparse.Namespace:
    """Return the arguments that are not ROS's. Prints the help and exits where it is asked for, or an argument is unknown."""
    lines = [f"  {item.name} (default {item.default!r}): {item.describe()}" for item in OPTIONS.values()]
    parser = argparse.ArgumentParser(
        prog="planner", description="Plan Dubins paths from start_pose to each goal_pose on a map, with RRT or RRT*.",
        usage="%(prog)s [--help] [--print-parameters | --parameter-table] [--ros-args -p NAME:=VALUE ... --params-file FILE]",
        epilog="\n".join(["parameters:", *lines]), formatter_class=argparse.RawDescriptionHelpFormatter)
    printing = parser.add_mutually_exclusive_group()
    printing.add_argument("--print-parameters", action="store_const", dest="printed", const=as_yaml,
                          help="print a parameter file with all defaults and exit")
    printing.add_argument("--parameter-table", action="store_const", dest="printed", const=as_table,
                          help="print a table of all parameters in Markdown and exit")
    try:
        own = remove_ros_args(arguments)[1:]
    except RuntimeError as error:
        raise _refused_by_ros(error) from error
    return parser.parse_args(own)


def _refused_by_ros(error: RuntimeError) -> ConfigurationError:
    """Return what ROS says of its arguments, with the remedy."""
    if isinstance(error, rclpy_implementation.UnknownROSArgsError):
        return ConfigurationError(one_line(f"ROS knows none of the arguments {error} after --ros-args; correct them"))
    hint = next((hint for what, hint in REMEDIES.items() if what in str(error)), "")
    return ConfigurationError(one_line(str(error)) + hint)
