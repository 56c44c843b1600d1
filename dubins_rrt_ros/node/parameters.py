"""The node's parameters, declared from the options of dataclasses: the library's and the node's own."""

import array
import difflib
import math
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult

from dubins_rrt_ros.planning import OptionError, Problem, Settings, Thresholds, Vehicle, options
from dubins_rrt_ros.planning.maps.files import MAX_CELLS, UNKNOWN_GREY
from dubins_rrt_ros.planning.option import Option, convert_options, option
from dubins_rrt_ros.planning.text import quoted_name
from dubins_rrt_ros.planning.vehicle import OVERRIDING, overridden, without_overridden


@dataclass(frozen=True)
class NodeOptions:
    """Options of the node itself, not of the planner.

    Raises:
        OptionError: a field is of the wrong type or out of range.
    """

    map_file: str = option("", "map file, its URL, or the name of an installed map; empty: the map comes by topic")
    map_directory: str = option("", "directory that load_map may read from, with its subdirectories, after links are "
                                    "followed; map_file may be elsewhere; empty: any")
    global_frame: str = option("map", "frame of map, poses and path")
    map_transient_local: bool = option(True, "subscribe to the map as transient local, as map_server publishes it")
    max_map_cells: int = option(MAX_CELLS.default, MAX_CELLS.help, unit=MAX_CELLS.unit, low=MAX_CELLS.low, high=MAX_CELLS.high)
    unknown_grey: int = option(UNKNOWN_GREY.default, UNKNOWN_GREY.help, low=UNKNOWN_GREY.low, high=UNKNOWN_GREY.high)
    occupied_thresh: float = option(0.65, "cells of a grid by topic are occupied from this share on, as in map_server's files; "
                                          "those between the two thresholds are unknown", low=0.0, high=1.0)
    free_thresh: float = option(0.25, "cells of a grid by topic are free up to this share; a map of probabilities may need more, "
                                      "such as 0.49", low=0.0, high=1.0)
    publish_tree: bool = option(True, "publish the tree on ~/tree while somebody subscribes")
    publish: str = option("improvements", "paths of a request that are published: improvements, each better one; final, the last",
                          choices=("improvements", "final"))
    robot_base_frame: str = option("", "frame of the vehicle, whose transform is the start when planning begins; empty: it comes "
                                       "on start_pose or initialpose")
    transform_tolerance: float = option(0.5, "how long a transform that is not there yet is waited for", unit="s", low=0.0,
                                        high=60.0)
    transform_max_age: float = option(1.0, "age beyond which the vehicle's transform is not taken", unit="s", low=0.0,
                                      high=3600.0)
    replan_on_map_change: bool = option(False, "check what is left of the published path against every new map, and plan again")
    replan_rate: float = option(0.0, "how often the goal is planned again from the newest start, until it is reached; 0 is never",
                                unit="Hz", low=0.0, high=100.0)
    replan_gain: float = option(0.05, "share by which a path planned again must be shorter (or cost less) than what is left of "
                                      "the published one to replace it, unless that is no longer free", low=0.0, high=1.0)
    goal_reached_xy: float = option(0.25, "distance within which a goal is reached, and no longer planned again", unit="m",
                                    low=0.0, high=1e6)
    goal_reached_yaw: float = option(0.5, "heading error within which it is", unit="rad", low=0.0, high=math.pi)
    planner_ids: tuple[str, ...] = option(("GridBased",), "names by which Nav2's actions may ask for this planner")
    clear_costmap_service: bool = option(False, "answer global_costmap/clear_entirely_global_costmap, for which Nav2's default "
                                                "behaviour trees ask; there is nothing to clear")
    managed: bool = option(False, "be a lifecycle node, for a manager without bonds (bond_timeout 0.0)")
    check_invariants: bool = option(False, "for debugging: check the invariants of every answer, its path and its tree before "
                                           "it is published, which is slow")

    def __post_init__(self):
        convert_options(self)
        if not self.global_frame:
            raise OptionError("global_frame is ''; give the name of a frame, such as map")
        for name in ("global_frame", "robot_base_frame"):
            _check_frame(name, getattr(self, name))
        if self.robot_base_frame == self.global_frame:
            raise OptionError(f"robot_base_frame is {quoted_name(self.robot_base_frame)}, as global_frame is, so that the "
                              "vehicle would never move; give the vehicle's frame, such as base_link")
        if self.free_thresh >= self.occupied_thresh:
            raise OptionError(f"free_thresh is {self.free_thresh:g} and occupied_thresh {self.occupied_thresh:g}; make "
                              "free_thresh the smaller one")

    @property
    def thresholds(self) -> Thresholds:
        """The thresholds of cells in grids by topic."""
        return Thresholds.of_fractions(self.free_thresh, self.occupied_thresh)


def _check_frame(name: str, frame: str) -> None:
    if frame.startswith("/"):
        raise OptionError(f"{name} is {quoted_name(frame)}; tf2 knows no frames with a leading slash, give "
                          f"{quoted_name(frame.lstrip('/'))}")
    if not frame.isprintable() or frame != frame.strip():
        raise OptionError(f"{name} is {quoted_name(frame)}; give the name of a frame, such as map, without line breaks, control "
                          "characters and blanks around it")


@dataclass(frozen=True)
class Configuration:
    """The parameters' values at one time.

    Attributes:
        node, vehicle, settings: the options of these classes.
        problem: the options of Problem by name.
    """

    node: NodeOptions
    vehicle: Vehicle
    settings: Settings
    problem: Mapping[str, Any]


#: The classes whose options are parameters, and the titles of their sections.
CLASSES = {NodeOptions: "The node", Vehicle: "The vehicle", Problem: "The request", Settings: "The planner"}
OPTIONS: dict[str, Option] = {item.name: item for cls in CLASSES for item in options(cls)}
#: How a list of lists is given as a parameter.
AS_TEXT = "as text, in quotes, since ROS has no lists of lists"
_RESTART = "start the node again with another value"
#: Parameters that cannot be changed at run time, and what to do instead. They shape topics, where a change would have no
#: effect, or limit what anyone on the network may do.
READ_ONLY = {"map_file": f"load another map by ~/load_map, or {_RESTART}", "map_directory": _RESTART, "global_frame": _RESTART,
             "map_transient_local": _RESTART, "clear_costmap_service": _RESTART, "managed": _RESTART}


class Parameters:
    """The parameters of a node. A change of several is accepted as a whole or refused as a whole, with the reason.

    Args:
        node: an rclpy Node, on which they are declared.

    Raises:
        OptionError: a value given at start-up is of the wrong type or out of range, or does not fit the others.
    """

    def __init__(self, node: Any):
        self._node = node
        for item in OPTIONS.values():
            _declare(node, item)
        values = self._values()
        self._known = values, configuration(values)  # the last that were read; one tuple, as any thread may read
        # Only now: while they are declared one by one, values that belong together come one by one.
        node.add_on_set_parameters_callback(self.check)

    def read(self) -> Configuration:
        """Return the present values; any thread may ask for them.

        Between two values that are set together and do not fit each other alone, those before are returned.
        """
        values = self._values()
        known, present = self._known
        if values != known:
            with suppress(OptionError):
                present = configuration(values)
                self._known = values, present
        return present

    def unknown(self) -> list[str]:
        """Return a warning, of one sentence, for each value given at start-up whose parameter is not declared."""
        # rclpy has no public access to the values that were given; where this attribute is missing, only the warnings are lost.
        given = getattr(self._node, "_parameter_overrides", {})
        return [_unknown(name) for name in given if not (self._node.has_parameter(name) or name.startswith("qos_overrides."))]

    def overridden(self) -> list[str]:
        """Return a warning, of one sentence, for each value given at start-up in whose place another one is used."""
        given = getattr(self._node, "_parameter_overrides", {})
        return _without_effect({name: parameter.value for name, parameter in given.items()})

    def without_effect(self, changes: Iterable) -> list[str]:
        """Return the same for each of changes, given as rclpy's Parameters that are not set yet, that differs from its value."""
        values = self._values()
        changed = {change.name for change in changes if change.name in OPTIONS and change.value != values[change.name]}
        given = {change.name: change.value for change in changes}
        return _without_effect({name: value for name, value in (values | given).items()
                                if name in changed or name in OVERRIDING})

    def undeclared(self, changes: Iterable) -> SetParametersResult | None:
        """Return the refusal of changes of which one is of no parameter, that says which was meant; None where there are all.

        What rclpy says of it has no name.
        """
        name = next((change.name for change in changes if not self._node.has_parameter(change.name)), None)
        if name is None:
            return None
        return SetParametersResult(successful=False, reason=f"There is no parameter {quoted_name(name)}; {_near(name)}")

    def pending(self, changes: Iterable) -> list:
        """Return what remains to be set of changes, given as rclpy's Parameters.

        Read-only parameters that keep their value are left out, as a dump of all parameters holds them too; an integer becomes
        a float where one is due, so that the parameter stays a double.
        """
        return [_as_declared(change) for change in changes if not self._is_kept(change)]

    def _is_kept(self, change: Any) -> bool:
        return change.name in READ_ONLY and change.value == self._node.get_parameter(change.name).value

    def check(self, changes: Iterable) -> SetParametersResult:
        """Say whether changes, given as rclpy's Parameters, can be made together; the reason of a refusal names the remedy.

        rclpy calls this last, after its own checks of ranges and read-only parameters, whose reasons name no remedy.
        """
        wanted = {change.name: _listed(change.value) for change in changes if change.name in OPTIONS}
        try:
            for name, value in wanted.items():
                _check_alone(name, value)
            self._check_together(wanted)
        except OptionError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _check_together(self, wanted: Mapping[str, Any]) -> None:
        try:
            configuration({**self._values(), **wanted})
        except OptionError as error:
            named = re.findall(r"\w+", str(error))
            if len(wanted) > 1 or not any(name in named for name in OPTIONS.keys() - wanted.keys()):
                raise
            service = f"{self._node.get_fully_qualified_name()}/set_parameters_atomically"
            raise OptionError(f"{error}; while the node runs, change what belongs together in one call of {service}") from None

    def _values(self) -> dict[str, Any]:
        return {name: self._node.get_parameter(name).value for name in OPTIONS}


def configuration(values: Mapping[str, Any]) -> Configuration:
    """Return the values of all options as the library's types.

    Raises:
        OptionError: one is of the wrong type or out of range, or they do not fit each other.
    """
    node, vehicle, problem, settings = (
        {item.name: item.convert(values[item.name]) for item in options(cls)} for cls in CLASSES)
    return Configuration(NodeOptions(**node), Vehicle(**without_overridden(vehicle)), Settings(**settings), problem)


def descriptor(item: Option) -> ParameterDescriptor:
    """Return the descriptor of an option, which `ros2 param describe` shows."""
    result = ParameterDescriptor(name=item.name, description=item.describe(), read_only=item.name in READ_ONLY,
                                 additional_constraints=item.allowed() if item.choices else read_only(item.name),
                                 dynamic_typing=True)  # so that 1 is taken where 1.0 is meant
    if item.low is None or item.high is None:
        return result
    if item.type is float:
        result.floating_point_range = [FloatingPointRange(from_value=float(item.low), to_value=float(item.high))]
    else:
        result.integer_range = [IntegerRange(from_value=item.low, to_value=item.high)]
    return result


def _declare(node: Any, item: Option) -> None:
    # The full descriptor comes after our own check: a refusal by its range names no remedy.
    parameter = node.declare_parameter(item.name, item.default, ParameterDescriptor(dynamic_typing=True))
    _convert(item, parameter.value)
    node.set_parameters([_as_declared(parameter)])
    node.set_descriptor(item.name, descriptor(item))


def _as_declared(parameter: Any) -> Any:
    """Return a Parameter of rclpy, an integer as a float where its option is one."""
    item = OPTIONS.get(parameter.name)
    if item is None or (item.type, type(parameter.value)) != (float, int):
        return parameter
    try:
        return type(parameter)(parameter.name, value=float(parameter.value))
    except OverflowError:
        return parameter  # which is refused then


def _check_alone(name: str, value: Any) -> None:
    if name in READ_ONLY:
        raise OptionError(f"{name} is {read_only(name)}")
    _convert(OPTIONS[name], value)


def _convert(item: Option, value: Any) -> Any:
    """Return a parameter's value as the option's field holds it; a refusal says how a list is written."""
    try:
        return item.convert(value)
    except OptionError as error:
        if not item.text_form or isinstance(value, str):
            raise
        raise OptionError(f"{error}, {AS_TEXT}") from None


def read_only(name: str) -> str:
    """Return what to do instead of changing a parameter at run time; "" where it can be changed."""
    return f"read-only while the node runs: {READ_ONLY[name]}" if name in READ_ONLY else ""


def _unknown(name: str) -> str:
    return f"Unknown parameter {quoted_name(name)} is ignored; {_near(name)}"


def _near(name: str) -> str:
    """Return which parameter was likely meant by an unknown name, or where they are listed."""
    # A section that is nested too deep is part of the name.
    near = difflib.get_close_matches(name.rpartition(".")[2].lower(), OPTIONS, n=1)
    return f"did you mean {near[0]!r}?" if near else "planner --help lists the parameters"


def _without_effect(given: Mapping[str, Any]) -> list[str]:
    return [f"{name} has no effect, as {by} takes its place" for name, by in overridden(given).items()]


def _listed(value: Any) -> Any:
    """Return an array of rclpy's as a list, which reads better in a message."""
    return value.tolist() if isinstance(value, array.array) else value
