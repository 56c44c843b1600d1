"""A client that asks a planner for everything at random: poses, maps, parameters, services; and judges what comes back."""

import math
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav_msgs.srv import GetMap, LoadMap
from std_srvs.srv import Trigger

from dubins_rrt_ros.node.conversions import grid_from, grid_message, pose_message
from dubins_rrt_ros.node.parameters import OPTIONS
from dubins_rrt_ros.planning import (
    ClearanceField,
    DubinsCurve,
    GridMap,
    Map,
    Path,
    Problem,
    Vehicle,
    audit_path,
    load_map,
    options,
)
from dubins_rrt_ros.planning.maps.locate import find_map
from support.harness import Client, poses_of, values_of

#: The package's own maps, both kinds; and what load_map refuses.
OWN_MAPS = [f"{name}.{ending}" for name in ("block", "forest", "maze") for ending in ("yaml", "geojson")]
NO_MAPS = ["", "nowhere.yaml", "/proc/self/mem", "http://localhost/maze.yaml", "file:///etc/passwd", "package://rclpy/no.yaml"]
#: The parameters of a node at rest, and values that each of them takes in between.
AT_REST = {"planner": "rrt_star", "samples": 300, "planning_time": 0.5, "seed": 1, "path_spacing": 0.05}
#: Fewer cells than any grid here has.
FEW = 200
CAR = "[[0.9, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.9, -0.2]]"
TAKEN = {
    "planner": ["rrt", "rrt_star"], "samples": [1, 50, 300, 3000], "planning_time": [0.02, 0.2, 0.5, 1], "seed": [-1, 0, 7],
    "step_size": [0.0, 0.5, 2], "informed": [True, False], "shortcut": [True, False], "goal_bias": [0.0, 0.05, 1.0],
    "heading_sampling": ["uniform", "goal", "field", "mixed"], "turning_radius": [0.2, 0.5, 1, 3.0],
    "robot_radius": [0.0, 0.1, 0.2, 0.6], "footprint": ["", CAR], "allow_unknown": [True, False],
    "goal_tolerance_xy": [0.0, 0.5], "goal_tolerance_yaw": [0.0, 0.3], "any_goal_heading": [True, False],
    "path_spacing": [0.02, 0.05, 0.1], "publish_tree": [True, False], "replan_on_map_change": [True, False],
    "check_invariants": [True, False], "max_map_cells": [FEW, 100_000_000],
}
REFUSED = [{"samples": 0}, {"planner": "best"}, {"turning_radius": -1.0}, {"turning_radius": math.nan}, {"robot_radius": "wide"},
           {"footprint": "[[0, 0]]"}, {"wheelbase": 2.0}, {"map_file": "maze"}, {"step_size": math.inf}, {"no_such_parameter": 1},
           {"samples": 50, "seed": -2}, {"planning_time": 0}]
#: A search that goes on until it is cancelled.
ENDLESS = {"planner": "rrt_star", "samples": 10_000_000, "planning_time": 60.0}
#: Of requests to get_plan; some are refused [m].
TOLERANCES = [0.0, 0.0, 0.5, -1.0, math.nan, math.inf]
#: The share of the published paths that is judged here too.
JUDGED = 0.25
#: Turns of less are straight [rad], what is this near to each other is the same [m], and a path of no turns has this radius [m].
STRAIGHT, SAME, FLAT = 1e-7, 1e-6, 1e4
#: What the messages of answers have that are no last ones.
STILL_PLANNING = " so far"


class Soak:
    """Asks at random, a step at a time, and asserts of every answer what must hold.

    Attributes:
        steps: the last ones, in words.
        counts: how many of what there were.
    """

    def __init__(self, client: Client, rng: np.random.Generator):
        self._client, self._rng = client, rng
        self.steps: deque[str] = deque(maxlen=30)
        self.counts: Counter[str] = Counter()
        self._marks: list[int] = []  # plan_ids
        self._defaults = {name: option.default for name, option in OPTIONS.items()} | AT_REST
        self._values = dict(self._defaults)
        self._earlier, self._in_force = [], [self._values]  # the parameters in the step before, and in this one
        self._own_maps = [load_map(find_map(name)) for name in OWN_MAPS]
        self._sent_maps: deque[GridMap] = deque(maxlen=50)
        self._map = self._own_maps[0]  # where poses are drawn
        self._starts: deque[tuple] = deque(maxlen=1000)
        self._goals: deque[tuple] = deque(maxlen=1000)
        self._told: deque[dict] = deque(maxlen=300)  # the last statuses with a path, and with which parameters it can be
        self._heard = 0  # how many of the statuses that the client holds were looked at
        self._responses = []  # paths of services
        self._kinds = [self._one_goal, self._burst, self._ask_get_plan, self._cancel, self._load_map, self._publish_map,
                       self._change_part, self._clear_map, self._publish_no_map, self._set_parameters, self._set_bad_parameters,
                       self._get_map, self._change_while_planning]

    def step(self) -> None:
        """Do something, and wait for the answers."""
        self._do(self._one_of(self._kinds))
        self._judge_all()
        self._earlier, self._in_force = self._in_force, [self._values]
        self.counts["steps"] += 1

    def rest(self) -> None:
        """Bring the node to always the same state: parameters, map, start, and a goal that is reached."""
        self.steps.append("rest")
        self._change(self._defaults)
        assert self._loaded("block.yaml")
        self._send("start_pose", stamped((2.0, 3.0, 1.57)))
        goal = stamped((14.0, 10.0, 0.0))
        self._client.wait_for(lambda: self._end_goals(self._begin_goals([goal]))["error_name"] == "NONE", "a path at rest")
        assert self._client.call(Trigger, "cancel").message == "Nothing is being planned."
        self._judge_all()

    # Steps

    def _one_goal(self) -> None:
        if self._rng.random() < 0.6:
            self._send(self._one_of(["start_pose", "initialpose"]), self._pose())
        self._end_goals(self._begin_goals([self._pose()]))

    def _burst(self) -> None:
        self._end_goals(self._begin_goals([self._pose() for _ in range(self._rng.integers(2, 12))]))

    def _ask_get_plan(self) -> None:
        before = self._mark()
        self._end_plans(self._begin_plans(int(self._rng.integers(1, 5))), before)

    def _cancel(self) -> None:
        values = self._values
        self._change(values | ENDLESS)
        goal = self._begin_goals([self._pose()])
        before = self._mark()
        futures = self._begin_plans(int(self._rng.integers(0, 3)))
        self._spin(self._rng.uniform(0, 0.3))
        self._client.cancel(*futures)
        self._end_goals(goal)
        self._end_plans(futures, before)
        self._change(values)

    def _change_while_planning(self) -> None:
        goal = self._begin_goals([self._pose() for _ in range(self._rng.integers(1, 4))])
        changes = [self._publish_map, self._change_part, self._load_map, self._set_parameters, self._ask_get_plan]
        for _ in range(3):
            self._do(self._one_of(changes))
        self._end_goals(goal)

    def _load_map(self) -> None:
        if self._rng.random() < 0.3:
            assert not self._loaded(self._one_of(NO_MAPS))
            self.counts["refused"] += 1
        else:
            name = self._one_of(OWN_MAPS)
            assert self._loaded(name) == (name.endswith("geojson") or self._values["max_map_cells"] > FEW), name

    def _publish_map(self) -> None:
        cells = np.zeros(self._rng.integers(20, 200, 2), np.int8)
        for value in [100] * 8 + [-1] * 2:
            self._paint(cells, value)
        yaw = self._one_of([0.0, self._rng.uniform(-math.pi, math.pi)])
        self._send_map(GridMap(cells, self._one_of([0.05, 0.1, 0.25]), (*self._rng.uniform(-5, 5, 2), yaw)))

    def _change_part(self) -> None:
        last = self._last_sent()
        cells = last.data.copy()
        self._paint(cells, self._one_of([0, 100, -1]))
        self._send_map(replace(last, data=cells))

    def _clear_map(self) -> None:
        last = self._last_sent()
        self._send_map(replace(last, data=np.zeros_like(last.data)))

    def _publish_no_map(self) -> None:
        frame, resolution, width = self._one_of([("odom", 0.1, 9), ("map", math.nan, 9), ("map", 0.0, 9), ("map", 0.1, 8)])
        message = grid_message(GridMap(np.zeros((9, 9)), 0.1), frame, Time())
        message.info.resolution, message.info.width = resolution, width
        self._client.publish_map(message)
        self.counts["refused"] += 1

    def _set_parameters(self) -> None:
        names = self._rng.choice(list(TAKEN), self._rng.integers(1, 4), replace=False).tolist()
        drawn = {name: self._one_of(TAKEN[name]) for name in names}
        self._change(self._defaults if self._rng.random() < 0.1 else self._values | drawn)

    def _set_bad_parameters(self) -> None:
        answer = self._client.set_parameters(**self._one_of(REFUSED))
        assert not answer.successful
        assert answer.reason
        self.counts["refused"] += 1

    def _get_map(self) -> None:
        assert len(self._client.call(GetMap, "get_map").map.data) > 0

    # What is asked

    def _begin_goals(self, poses: list[PoseStamped]) -> int:
        """Send goals one right after the other; the plan_id of the newest."""
        for pose in poses:
            self._send("goal_pose", pose)
            self._spin(self._one_of([0.0, 0.0, 0.005]))
        # The last goal may come between the marks, though it was sent before: topics and services keep no common order.
        first, second = self._mark(), self._mark()
        return second - 1 if second > first + 1 else first - 1

    def _end_goals(self, plan_id: int) -> dict[str, str]:
        """Wait for the last answer to a goal."""
        told = self._client.wait_for(lambda: self._answers().get(plan_id), f"the answer to goal {plan_id}")
        self.counts["goals answered"] += 1
        return told

    def _begin_plans(self, count: int) -> list:
        return [self._client.request_plan(self._noted(self._starts, self._pose()), self._noted(self._goals, self._pose()),
                                          tolerance=self._one_of(TOLERANCES)) for _ in range(count)]

    def _end_plans(self, futures: list, before: int) -> None:
        """Wait for the responses to get_plan and for the answers to all that was asked after `before`, a mark."""
        self._responses += [self._client.response(future).plan for future in futures]
        asked = set(range(before + 1, self._mark())).difference(self._marks)
        self._client.wait_for(lambda: asked <= set(self._answers()), f"the answers to {asked}")
        self.counts["services answered"] += len(futures)

    def _mark(self) -> int:
        """A plan_id of its own: what came in before has a lower one, and what comes later a higher one."""
        place = float(len(self._marks))
        nowhere = PoseStamped(pose=Pose(position=Point(x=math.nan, y=place)))
        assert self._client.response(self._client.request_plan(nowhere, nowhere)).plan.poses == []
        self._marks.append(int(self._client.wait_for(lambda: next(
            (values_of(status)["plan_id"] for status in self._client.statuses if f"x nan, y {place}," in status.message), None),
            f"the refusal of mark {place}")))
        return self._marks[-1]

    def _answers(self) -> dict[int, dict[str, str]]:
        """The last statuses of requests, by plan_id."""
        return {int(told["plan_id"]): told for status in self._client.statuses if STILL_PLANNING not in status.message
                for told in [values_of(status)]}

    def _change(self, values: dict) -> None:
        changes = {name: value for name, value in values.items() if value != self._values[name]}
        answer = changes and self._client.set_parameters(**changes)
        assert not changes or answer.successful, answer.reason
        self._values = values
        self._in_force.append(values)
        self.counts["parameters set"] += len(changes)

    def _loaded(self, name: str) -> bool:
        """Whether a map could be loaded."""
        taken = self._client.call(LoadMap, "load_map", map_url=name).result == LoadMap.Response.RESULT_SUCCESS
        if taken:
            self._map = self._own_maps[OWN_MAPS.index(name)]
            self.counts["maps"] += 1
        return taken

    def _send_map(self, sent: GridMap) -> None:
        message = grid_message(sent, "map", Time())
        self._sent_maps.append(grid_from(message, "map", sent.data.size))  # as it is received, of the same id
        self._map = self._sent_maps[-1]
        self._client.publish_map(message)
        self.counts["maps"] += 1

    def _last_sent(self) -> GridMap:
        if not self._sent_maps:
            self._publish_map()
        return self._sent_maps[-1]

    def _send(self, topic: str, pose: PoseStamped) -> None:
        self._client.send(topic, self._noted(self._goals if topic == "goal_pose" else self._starts, pose))

    def _noted(self, poses: deque[tuple], pose: PoseStamped) -> PoseStamped:
        poses.append((pose.pose.position.x, pose.pose.position.y))
        return pose

    # What is drawn

    def _do(self, step: Callable[[], None]) -> None:
        self.steps.append(step.__name__.strip("_").replace("_", " "))
        step()

    def _one_of(self, things: list) -> Any:
        return things[self._rng.integers(len(things))]

    def _spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._client.spin_once()

    def _paint(self, cells: np.ndarray, value: int) -> None:
        """Give a random rectangle this value."""
        (low, left), (height, width) = self._rng.integers(0, cells.shape), self._rng.integers(1, 30, 2)
        cells[low:low + height, left:left + width] = value

    def _pose(self) -> PoseStamped:
        """A pose that is on the map most often, in half of the cases at the widest of some places, else anywhere."""
        corners = self._map.corners()
        places = corners[0] + self._rng.random((self._one_of([1, 8]), 2)) @ (corners[[1, 3]] - corners[0])
        place = places[np.argmax(ClearanceField(self._map).at(places))]
        pose = stamped((*place.tolist(), self._rng.uniform(-math.pi, math.pi)), self._one_of(["map"] * 20 + ["", "odom"]))
        match self._rng.integers(20):
            case 0:
                pose.pose.position.x += self._one_of([1e3, -1e3, 1e300])
            case 1:
                pose.pose.position.y = self._one_of([math.nan, math.inf])
            case 2:
                pose.pose.orientation = Quaternion(x=0.7, w=self._one_of([0.0, 0.7, math.nan]))
        return pose

    # What is judged

    def _judge_all(self) -> None:
        """Hear what was told of paths, and judge those that came."""
        client = self._client
        for exact, paths in ((True, client.paths), (False, self._responses)):
            for path in paths:
                if path.poses:
                    self._judge(poses_of(path), exact)
        self._hear()
        for heard in (client.paths, client.statuses, client.trees, self._responses):
            heard.clear()
        self._heard = 0

    def _hear(self) -> None:
        for status in self._client.statuses[self._heard:]:
            self._heard += 1
            told = values_of(status)
            assert told["error_name"] != "UNKNOWN", status.message
            if told["path_length"]:
                assert (told["error_name"], told["audit"]) == ("NONE", "ok"), status.message
                self._told.append(told | {"with": self._earlier + self._in_force})

    def _judge(self, poses: np.ndarray, exact: bool) -> None:
        self.counts["paths"] += 1
        assert tuple(poses[0, :2]) in self._starts
        exact = exact and not any(values["goal_tolerance_xy"] for values in self._earlier + self._in_force)
        off = min(math.dist(poses[-1, :2], goal) for goal in self._goals if all(map(math.isfinite, goal)))
        assert off <= (SAME if exact else 0.5 + SAME)
        length = length_of(poses)
        told = self._client.wait_for(lambda: self._status_of(length), f"the status of a path of {length} m")
        if self._rng.random() < JUDGED:
            self.counts["paths judged here"] += 1
            path = driven(poses, float(told["max_curvature"]))
            findings = [self._findings(path, told, values) for values in told["with"]]
            assert () in findings, f"a path of {length} m on map {told['map_id']}: {findings}"

    def _status_of(self, length: float) -> dict | None:
        """The newest status of a path of this length, on a map that is kept: an older one tells of another path as long."""
        self._hear()
        return next((told for told in reversed(self._told)
                     if abs(float(told["path_length"]) - length) <= SAME and self._map_of(told)), None)

    def _map_of(self, told: dict) -> Map | None:
        """The map that a status tells of, if it is kept."""
        return next((one for one in (*self._own_maps, *self._sent_maps) if one.id == told["map_id"]), None)

    def _findings(self, path: Path, told: dict, values: dict) -> tuple[str, ...]:
        """What the audit finds of a path for the vehicle of these parameters."""
        vehicle = Vehicle(**{item.name: values[item.name] for item in options(Vehicle)})
        problem = Problem(self._map_of(told), vehicle, path.start, path.end, allow_unknown=values["allow_unknown"])
        return audit_path(path, problem).findings


def stamped(pose: tuple[float, float, float], frame: str = "map") -> PoseStamped:
    """An (x, y, yaw) as a message."""
    message = PoseStamped(pose=pose_message(pose))
    message.header.frame_id = frame
    return message


def driven(poses: np.ndarray, curvature: float) -> Path:
    """The path of (n, 3) poses, each of them reached from the one before straight ahead or by a turn of this curvature [1/m]."""
    rows = list(map(tuple, poses.tolist()))
    radius = 1 / curvature if curvature else FLAT
    return Path.of_curves(rows[0], rows[-1], [_piece(*pair, radius) for pair in pairwise(rows)])


def _piece(start: tuple, end: tuple, radius: float) -> DubinsCurve:
    """From one pose as far as to the next, and with the same turn."""
    turn = math.remainder(end[2] - start[2], math.tau)
    if abs(turn) < STRAIGHT:
        return DubinsCurve(start, radius, "LSL", (0.0, math.dist(start[:2], end[:2]), 0.0))
    return DubinsCurve(start, radius, "LSL" if turn > 0 else "RSR", (radius * abs(turn), 0.0, 0.0))


def length_of(poses: np.ndarray) -> float:
    """The length of the path of (n, 3) poses, whatever its curvature is [m]."""
    chords = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    half = np.remainder(np.diff(poses[:, 2]) + math.pi, math.tau) / 2 - math.pi / 2
    return float((chords / np.sinc(half / math.pi)).sum())
