"""The latencies of `dubins_rrt bench --node`: how soon the node answers, in wall time and in its CPU time."""

from collections.abc import Generator, Iterator, Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_rrt_ros.planning import GridMap, Settings, options

from ..demo.process import enter_domain, running_planner
from .problems import Case
from .report import table

if TYPE_CHECKING:
    from .node_client import Answer, NodeClient

#: Number of requests of each kind, unless told.
REQUESTS = 100
#: The change from one goal, or start, to the next [m]: of a goal that is another one, as a cost-to-go is kept for each goal, and
#: of a start that has driven on.
NEXT_GOAL, NEXT_START = 1e-5, 1e-3
#: Time for which the CPU time of an idle node, and of one that gets an equal map, is measured [s].
IDLE, EQUAL_MAP = 10.0, 0.1
#: Time between two maps of which each leads to another path [s]: until nothing is planned any more.
BETWEEN_MAPS = 0.5
#: Rates of maps and of transforms while it is idle [Hz].
MAP_RATE, TRANSFORM_RATE = 1, 50
#: Figures of a group, as quantiles.
QUANTILES = {"least": 0.0, "p50": 0.5, "p99": 0.99}
#: Cells of a map of which a window changes, of that window, and of a map that is sent again and again; each cell is 0.1 m wide.
CELLS, WINDOW, SMALL = 1000, 100, 400
#: A start and a goal on both sides of the window.
START, GOAL = (10.0, 50.0, 0.0), (90.0, 50.0, 0.0)


def measure(cases: Sequence[Case], settings: Settings, count: int) -> Generator[dict[str, Any], None, None]:
    """Time `count` requests of each kind on each problem, then on changing maps, then the idle node; yield each as a line.

    Raises:
        DemoError: ROS is not here, or the node does not answer.
    """
    enter_domain()
    from .node_client import NodeClient
    for case in cases:
        parameters = _parameters(case, settings)
        with running_planner(parameters) as planner, NodeClient(planner) as client:
            client.wait_until_ready()
            yield from (line | {"problem": case.name} for line in _of_problem(client, case, count))
    by_topic: dict[str, Any] = {"replan_on_map_change": True, "replan_gain": 0.0}
    with running_planner(by_topic) as planner, NodeClient(planner) as client:
        yield from _of_maps(client, count)
    if find_spec("tf2_msgs") is not None:
        from .node_client import ROBOT_FRAME
        with running_planner({"robot_base_frame": ROBOT_FRAME}) as planner, NodeClient(planner) as client:
            yield _idle(client, "idle with transforms", TRANSFORM_RATE)


def number_of_lines(cases: Sequence[Case], count: int) -> int:
    """Return how many lines `measure` yields."""
    return count * (3 * len(cases) + 2) + 1 + (find_spec("tf2_msgs") is not None)


def _parameters(case: Case, settings: Settings) -> dict[str, Any]:
    """Return the node's parameters for a problem, those that are not the default."""
    fields = [(item, getattr(owner, item.name)) for owner in (case.vehicle, settings) for item in options(type(owner))]
    values = {item.name: item.text_form.write(value) if item.text_form else value for item, value in fields}
    given = {item.name: values[item.name] for item, _ in fields if values[item.name] != item.default} | dict(case.request)
    # In quotes, or ROS takes the text of a footprint for a list of lists, which no parameter is.
    texts = {name: f"'{value}'" for name, value in given.items() if isinstance(value, str)}
    return given | texts | {"map_file": case.map.resolve()}


def _of_problem(client: "NodeClient", case: Case, count: int) -> Iterator[dict[str, Any]]:
    client.send_start(case.start)
    (x, y, yaw), (start_x, start_y, start_yaw) = case.goal, case.start
    ahead = NEXT_START * np.array([np.cos(start_yaw), np.sin(start_yaw), 0.0])
    client.first_path(case.goal)  # what only the first request takes is not measured
    for number in range(count):
        client.cancel()
        yield _line("goal", number, client.first_path((x + NEXT_GOAL * (number + 1), y, yaw)))
    for number in range(count):
        client.cancel()
        moved = np.array((start_x, start_y, start_yaw)) + ahead * (1 + number % 50)
        client.send_start((moved[0], moved[1], start_yaw))
        yield _line("start moved", number, client.first_path(case.goal))
    client.cancel()
    for number in range(count):
        yield _line("get_plan", number, client.plan(case.start, (x + NEXT_GOAL * (number + 1), y, yaw)))


def _of_maps(client: "NodeClient", count: int) -> Iterator[dict[str, Any]]:
    """Yield lines of maps in whose middle a block comes and goes, of equal ones, and of none but these."""
    free, blocked = np.zeros((2, CELLS, CELLS), np.int8)
    middle = slice((CELLS - WINDOW) // 2, (CELLS + WINDOW) // 2)
    blocked[middle, middle] = 100
    grids = [GridMap(cells, 0.1) for cells in (free, blocked)]
    client.send_start(START)
    client.send_map(grids[0])
    client.wait_until_ready()
    client.first_path(GOAL)
    client.path_on(grids[1])
    for number in range(count):
        yield _line("map window", number, client.path_on(grids[number % 2]))
        client.spin(BETWEEN_MAPS)
    client.cancel()
    for number in range(count):
        wall, cpu = client.cpu_of(lambda: client.send_map(grids[(count - 1) % 2]), EQUAL_MAP)
        yield {"measured": "equal map", "number": number, "wall_s": wall, "cpu_s": cpu}
    yield _idle(client, "idle", 0)


def _idle(client: "NodeClient", name: str, transforms: int) -> dict[str, Any]:
    """Return the share of a core that a node takes which gets nothing but an equal map each second, and transforms."""
    grid = GridMap(np.zeros((SMALL, SMALL), np.int8), 0.1)
    client.send_map(grid)
    client.wait_until_ready()

    def send() -> None:
        for tick in range(round(IDLE * (rate := transforms or MAP_RATE))):
            if tick % (rate // MAP_RATE) == 0:
                client.send_map(grid)
            if transforms:
                client.send_transform(START)
            client.spin(1 / rate)

    client.spin(1.0)
    wall, cpu = client.cpu_of(send, IDLE)
    return {"measured": name, "number": 0, "wall_s": wall, "cpu_s": cpu, "share": cpu / wall}


def _line(measured: str, number: int, answer: "Answer") -> dict[str, Any]:
    figures = answer.figures
    line: dict[str, Any] = {"measured": measured, "number": number, "wall_s": answer.wall, "cpu_s": answer.cpu,
                            "error_name": figures["error_name"], "map_id": figures["map_id"]}
    line |= {name: float(figures[name]) for name in ("time_to_first", "planning_time", "path_length") if figures[name]}
    if answer.poses:
        line |= {"poses": answer.poses, "over_s": answer.wall - line["planning_time"]}
    return line


def latencies(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return a table in Markdown of the times of each problem and kind of request [ms]."""
    clocks = {"wall": "wall_s", "CPU": "cpu_s", "planning": "time_to_first", "beyond planning": "over_s"}
    head = ["problem", "measured", "number", *(f"{name}, {clock} [ms]" for clock in clocks for name in QUANTILES), "poses"]
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for line in lines:
        groups.setdefault((line.get("problem", ""), line["measured"]), []).append(line)
    rows = [[problem, measured, str(len(group)), *(text for key in clocks.values() for text in _quantiles(group, key)),
             str(max(line.get("poses", 0) for line in group) or "")]
            for (problem, measured), group in groups.items()]
    shares = [f"{line['measured']}: {line['share']:.2%} of a core" for line in lines if "share" in line]
    return "\n".join([table(head, rows), *shares])


def _quantiles(group: Sequence[Mapping[str, Any]], key: str) -> list[str]:
    values = [line[key] for line in group if key in line]
    return [f"{1e3 * float(np.quantile(values, share)):.2f}" if values else "" for share in QUANTILES.values()]
