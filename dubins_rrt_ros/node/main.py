"""The node's process: arguments, signals, exit status."""

import argparse
import contextlib
import signal
import sys

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import uninstall_signal_handlers
from rclpy.utilities import remove_ros_args

from dubins_rrt_ros.planning import MapError, OptionError
from dubins_rrt_ros.planning.text import one_line

from .parameter_files import as_yaml, unused_files
from .parameter_table import as_table
from .parameters import AS_TEXT, OPTIONS
from .planner_node import PlannerNode

#: What ROS says of a list of lists in a parameter file.
NESTED_LIST = "Sequences cannot be key"
#: Maximum time until a signal is noticed [s].
SIGNAL_INTERVAL = 0.25


class ConfigurationError(Exception):
    """A configuration with which the node cannot start; the message, of one line, names what to change."""


def main(args: list[str] | None = None) -> int:
    """Run the node and return the exit status: 1 where its configuration cannot be used."""
    try:
        return _run(sys.argv if args is None else args)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0  # SIGINT and SIGTERM end it regularly, also while something is published, which then fails
    except ConfigurationError as error:
        print(f"planner: {error}", file=sys.stderr)
        return 1


def _run(arguments: list[str]) -> int:
    node = executor = None
    try:
        if printed := _parse(arguments).printed:
            print(printed(), end="")
            return 0
        node = _configured_node(arguments)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        _spin(executor, node)
    finally:
        # A second signal must not interrupt the shutdown.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        # Waits for the thread in which rclpy acts on signals: it uses what executors destroy when they are shut down.
        uninstall_signal_handlers()
        if node is not None:
            node.close()
        if executor is not None:
            executor.shutdown()  # the garbage collector may take it after what it refers to, with a traceback
        with contextlib.suppress(RuntimeError):  # the signal's own thread may be first
            rclpy.try_shutdown()
    return 0


def _spin(executor: SingleThreadedExecutor, node: PlannerNode) -> None:
    # Not spin(): a signal can come between its check of the context and its wait, which then never ends.
    while rclpy.ok():
        try:
            executor.spin_once(timeout_sec=SIGNAL_INTERVAL)
        except ExternalShutdownException:
            raise
        except Exception as error:  # of any kind: the node goes on
            if not rclpy.ok():  # a signal came while something was published, which then fails
                raise ExternalShutdownException from error
            node.report_defect(error)


def _configured_node(arguments: list[str]) -> PlannerNode:
    try:
        rclpy.init(args=arguments)
    except RuntimeError as error:  # a ROS argument or a parameter file that cannot be read
        raise _refused_by_ros(error) from error
    try:
        node = PlannerNode()
    except MapError as error:
        raise ConfigurationError(f"map_file: {error}") from error
    except (OptionError, NameValidationException, ParameterException) as error:
        raise ConfigurationError(one_line(str(error))) from error
    except Exception as error:
        if not rclpy.ok():  # a signal came meanwhile
            raise ExternalShutdownException from error
        raise
    for warning in unused_files(arguments, node.get_fully_qualified_name()):
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
    """Return what ROS says of its arguments, with the remedy where it met a list of lists."""
    hint = f"; give a footprint {AS_TEXT}: footprint: \"[[x, y], ...]\"" if NESTED_LIST in str(error) else ""
    return ConfigurationError(one_line(str(error)) + hint)
