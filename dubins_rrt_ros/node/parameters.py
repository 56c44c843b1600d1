"""The node's parameters, declared from the options of the library's dataclasses."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult

from dubins_rrt_ros.planning import OptionError, Problem, Settings, Vehicle, options
from dubins_rrt_ros.planning.options import Option, convert_options, option


@dataclass(frozen=True)
class NodeOptions:
    """What concerns the node and not the planner.

    Raises:
        OptionError: a field is of the wrong type or out of range.
    """

    map_file: str = option("", "a map file, or the name of an installed map; empty: the map comes by topic")
    global_frame: str = option("map", "the frame of map, poses and path")
    map_transient_local: bool = option(True, "the map topic's publisher is transient local, as map_server's is")
    max_map_cells: int = option(100_000_000, "the largest map that is taken", unit="cells", low=1, high=2**31 - 1)
    publish_tree: bool = option(True, "show the tree on ~/tree while somebody subscribes")

    def __post_init__(self):
        convert_options(self)
        if not self.global_frame:
            raise OptionError("global_frame is ''; give the name of a frame, such as map")


@dataclass(frozen=True)
class Configuration:
    """The parameters' values at one time; `problem` holds the options of Problem by name."""

    node: NodeOptions
    vehicle: Vehicle
    settings: Settings
    problem: Mapping[str, Any]


CLASSES = (NodeOptions, Vehicle, Problem, Settings)
OPTIONS: dict[str, Option] = {item.name: item for cls in CLASSES for item in options(cls)}
#: They shape topics and are read once; a change at run time would have no effect.
READ_ONLY = frozenset({"map_file", "global_frame", "map_transient_local"})

class Parameters:
    """The parameters of a node.

    A change is taken whole or refused whole, with the reason.

    Raises:
        OptionError: a value given at start-up is of the wrong type or out of range, or does not fit the others.
    """

    def __init__(self, node):
        self._node = node
        for item in OPTIONS.values():
            _declare(node, item)
        self.read()
        # Only now: while they are declared one by one, values that belong together come one by one.
        node.add_on_set_parameters_callback(self._check)

    def read(self) -> Configuration:
        """The present values."""
        return configuration(self._values())

    def _values(self) -> dict[str, Any]:
        return {name: self._node.get_parameter(name).value for name in OPTIONS}

    def _check(self, changes) -> SetParametersResult:
        wanted = self._values() | {change.name: change.value for change in changes if change.name in OPTIONS}
        try:
            configuration(wanted)
        except OptionError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)


def configuration(values: Mapping[str, Any]) -> Configuration:
    """The values of all options as the library's types.

    Raises:
        OptionError: one is of the wrong type or out of range, or they do not fit each other.
    """
    node, vehicle, problem, settings = (
        {item.name: item.convert(values[item.name]) for item in options(cls)} for cls in CLASSES)
    return Configuration(NodeOptions(**node), Vehicle(**vehicle), Settings(**settings), problem)


def descriptor(item: Option) -> ParameterDescriptor:
    """What `ros2 param describe` tells of an option."""
    result = ParameterDescriptor(name=item.name, description=item.describe(), read_only=item.name in READ_ONLY,
                                 additional_constraints=item.allowed() if item.choices else "",
                                 dynamic_typing=True)  # so that 1 is taken where 1.0 is meant
    if item.type is float:
        result.floating_point_range = [FloatingPointRange(from_value=float(item.low), to_value=float(item.high))]
    elif item.type is int:
        result.integer_range = [IntegerRange(from_value=item.low, to_value=item.high)]
    return result


def _declare(node, item: Option) -> None:
    # The full descriptor comes after our own check: its refusal would not say what to do.
    parameter = node.declare_parameter(item.name, item.default, ParameterDescriptor(dynamic_typing=True))
    item.convert(parameter.value)
    node.set_descriptor(item.name, descriptor(item))
