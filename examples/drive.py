#!/usr/bin/env python3
"""Drive a simulated car with the node, in real time, on a map that changes: people walk through it, and some cells are wrong.

    examples/drive.py --minutes 5 --seed 1 [--map maze] [--robots 2]

The car follows `plan` by pure pursuit, with noise in its pose and lag in its steering. It is planned for with a radius 0.1 m
larger than its body. One line of JSON tells of each goal, and a last one of the whole drive; a judge that is not the planner
measures, from true poses, how near the body came to what was on the map. `standstill` is the longest time without a path while
nobody was near the car or where it is to go, `without_path` that in all cases. The exit status is 1 if it touched anything or
reached no goal.
"""

import argparse
import json
import math
import subprocess
import sys
import time
from dataclasses import dataclass, field

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from scipy.ndimage import distance_transform_edt

from dubins_rrt_ros.cli.demo.process import planner_command
from dubins_rrt_ros.node.conversions import grid_message, pose_message
from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, load_map, plan
from dubins_rrt_ros.planning.maps.locate import find_map

BODY, MARGIN, TURNING_RADIUS = 0.2, 0.1, 1.0
#: What the car can do: its speed [m/s], its curvature [1/m], and the time constant of its steering [s].
SPEED, MOST_CURVATURE, STEERING_LAG = 0.7, 1.25, 0.1
#: Distance along the path at which it is steered [m], and the standard deviations of its pose [m, rad].
LOOKAHEAD, NOISE_XY, NOISE_YAW = 0.5, 0.01, 0.01
#: Period of the simulation, of poses and of maps [s].
STEP, POSE_PERIOD, MAP_PERIOD = 0.02, 0.05, 0.5
#: Of people: their number, radius [m], speed [m/s], how near to a car they turn back, and how far a car sees them [m].
PEOPLE, PERSON, WALK, SHY, SIGHT = 3, 0.2, 0.6, 1.2, 6.0
#: Number of poses of the path that a driver looks ahead, and where a car has the right of way.
LOOK, LOOK_FOR_CARS = 25, 60
#: Number of wrong cells in each map.
SPECKLE = 2
#: Maximum number of places that are tried for a goal.
MOST_TRIES = 50
#: Within this of the goal it is reached [m, rad]; a goal is given up after this time [s].
REACHED_XY, REACHED_YAW, PATIENCE = 0.25, 0.5, 180.0
#: Somebody who is so near to a car, a waypoint or the goal may leave no arc from it or to it [m].
NEARBY = 1.5
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PARAMETERS = {"robot_radius": BODY + MARGIN, "turning_radius": TURNING_RADIUS, "replan_on_map_change": True, "replan_rate": 2.0,
              "start_slack": MARGIN, "samples": 500, "planning_time": 1.0,
              "goal_tolerance_xy": 0.6 * REACHED_XY, "goal_tolerance_yaw": 0.6 * REACHED_YAW}


@dataclass
class Floor:
    """What is really there: walls, and people who walk.

    Attributes:
        grid: the walls.
        distance: of each cell to the nearest wall [m].
        people: (n, 4) x, y [m] and their velocity [m/s].
    """

    grid: GridMap
    rng: np.random.Generator
    distance: np.ndarray = field(init=False)
    people: np.ndarray = field(init=False)

    def __post_init__(self):
        free = self.grid.data < 25
        self.distance = distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * self.grid.resolution
        self.people = np.array([[*self.random_place(0.5), 0.0, 0.0] for _ in range(PEOPLE)])

    def random_place(self, room: float) -> tuple[float, float]:
        """Return a place that is so far from all walls [m]."""
        rows, columns = np.nonzero(self.distance >= room)
        pick = self.rng.integers(len(rows))
        x, y = self.grid.origin[:2]
        return x + (columns[pick] + 0.5) * self.grid.resolution, y + (rows[pick] + 0.5) * self.grid.resolution

    def room(self, x: float, y: float) -> float:
        """Return the distance of a point to the nearest wall, to within a cell [m]."""
        column, row = (int((a - b) / self.grid.resolution) for a, b in zip((x, y), self.grid.origin[:2], strict=True))
        height, width = self.distance.shape
        return self.distance[row, column] if 0 <= row < height and 0 <= column < width else 0.0

    def walk(self, seconds: float, cars: list[np.ndarray]) -> None:
        """Let people walk on; they turn at walls, and away from cars."""
        for person in self.people:
            near = [car for car in cars if math.dist(car[:2], person[:2]) < SHY]
            if not self._step(person, seconds, near) or not person[2:].any():
                away = math.atan2(*(person[:2] - near[0][:2])[::-1]) if near else self.rng.uniform(-math.pi, math.pi)
                angle = away + self.rng.uniform(-1.0, 1.0)
                person[2:] = WALK * math.cos(angle), WALK * math.sin(angle)

    def _step(self, person: np.ndarray, seconds: float, near: list[np.ndarray]) -> bool:
        """Let a person take a step where no wall is, and no car comes nearer by it; return True if so."""
        x, y = person[:2] + seconds * person[2:]
        if self.room(x, y) < 0.35 or any(math.dist(car[:2], (x, y)) < math.dist(car[:2], person[:2]) for car in near):
            return False
        person[:2] = x, y
        return True

    def seen(self, car: np.ndarray, others: list[np.ndarray]) -> GridMap:
        """Return the map as a car has it: walls, people and other cars in sight, and wrong cells."""
        cells = self.grid.data.copy()
        height, width = cells.shape
        x = self.grid.origin[0] + (np.arange(width) + 0.5) * self.grid.resolution
        y = self.grid.origin[1] + (np.arange(height) + 0.5) * self.grid.resolution
        reach = self.grid.resolution * math.sqrt(0.5)  # to whose middle a cell that is touched reaches
        discs = [(*person[:2], PERSON + reach) for person in self.people] + [(*other[:2], BODY + reach) for other in others]
        for px, py, radius in discs:
            if math.dist((px, py), car[:2]) < SIGHT:
                cells[np.hypot(x[None, :] - px, y[:, None] - py) < radius] = 100
        cells[self.rng.integers(height, size=SPECKLE), self.rng.integers(width, size=SPECKLE)] = 100
        return GridMap(cells, self.grid.resolution, self.grid.origin, self.grid.name, percent=True)


class Car:
    """A car with a planner of its own, in a namespace of its own."""

    def __init__(self, number: int, floor: Floor, executor: SingleThreadedExecutor, rng: np.random.Generator):
        self._number, self._floor, self._rng = number, floor, rng
        self.namespace = f"/car{number}"
        rules = [part for name, value in PARAMETERS.items() for part in ("-p", f"{name}:={json.dumps(value)}")]
        self.planner = subprocess.Popen([*planner_command(), "--ros-args", "-r", f"__ns:={self.namespace}", *rules],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT)
        node = rclpy.create_node("car", namespace=self.namespace)
        executor.add_node(node)
        self._starts = node.create_publisher(PoseStamped, "start_pose", 1)
        self._routes = node.create_publisher(PoseArray, "goal_poses", 1)
        self._maps = node.create_publisher(OccupancyGrid, "map", LATCHED)
        node.create_subscription(PathMessage, "plan", self._on_plan, LATCHED)
        self._home = self._random_home()
        self.pose = np.array(self._home)
        self._last_place = self._home
        self._curvature = 0.0
        self._plan = np.empty((0, 3))
        self._at = 0  # index of the pose that was passed last
        self._route: list[np.ndarray] = []
        self.results: list[dict] = []  # of goals that ended
        self.result: dict = {}  # of the one that is driven to

    @property
    def is_connected(self) -> bool:
        """True once the planner hears all."""
        return all(topic.get_subscription_count() for topic in (self._starts, self._routes, self._maps))

    def _on_plan(self, message: PathMessage) -> None:
        poses = [(p.pose.position.x, p.pose.position.y, 2 * math.atan2(p.pose.orientation.z, p.pose.orientation.w))
                 for p in message.poses]
        self._plan, self._at = np.array(poses).reshape(-1, 3), 0
        self.result["plans"] += len(poses) > 0
        if len(poses) and "shortest" not in self.result:
            self.result["shortest"] = float(np.hypot(*np.diff(self._plan[:, :2], axis=0).T).sum())

    def _random_pose(self, room: float) -> tuple[float, float, float]:
        x, y = self._floor.random_place(room)
        return float(x), float(y), float(self._rng.uniform(-math.pi, math.pi))

    def _random_home(self) -> tuple[float, float, float]:
        """Return a pose from which a way leads to others, and back again."""
        for _ in range(MOST_TRIES):
            home, other = self._random_pose(0.6), self._random_pose(0.6)
            if self._is_solved(home, other) and self._is_solved(other, home):
                return home
        raise SystemExit("there is hardly room to drive on this map")

    def _is_solved(self, start: tuple, goal: tuple) -> bool:
        problem = Problem(self._floor.grid, Vehicle(TURNING_RADIUS, BODY + MARGIN), start, goal)
        return plan(problem, Settings(planner="rrt", planning_time=0.3, seed=1)).solved

    def _next_place(self, here: tuple) -> tuple[float, float, float]:
        """Return a pose that a way leads to, and from which one leads home; home itself where none is found."""
        for _ in range(MOST_TRIES):
            place = self._random_pose(BODY + MARGIN + 0.15)
            if math.dist(here[:2], place[:2]) > 2.0 and self._is_solved(here, place) and self._is_solved(place, self._home):
                return place
        return self._home

    def choose_goal(self) -> None:
        """Ask for a path to a place, sometimes over another one."""
        places = [self._next_place(self._last_place)]
        if len(self.results) % 3 == 2:
            places.append(self._next_place(places[0]))
        self._last_place = places[-1]
        self._route = [np.array(place) for place in places]
        self.result = {"car": self.namespace, "goal": [round(a, 3) for a in places[-1]], "waypoints": len(places) - 1,
                        "reached": False, "seconds": 0.0, "driven": 0.0, "plans": 0, "standstill": 0.0, "without_path": 0.0,
                        "least_room": math.inf}
        self._plan = np.empty((0, 3))
        self._stood = self._without_path = 0.0
        message = PoseArray(poses=[pose_message(place) for place in places])
        message.header.frame_id = "map"
        self._routes.publish(message)

    def publish_pose(self) -> None:
        """Publish where the car believes to be."""
        x, y, yaw = self.pose + self._rng.normal(0.0, (NOISE_XY, NOISE_XY, NOISE_YAW))
        message = PoseStamped(pose=pose_message((x, y, yaw)))
        message.header.frame_id = "map"
        self._starts.publish(message)

    def publish_map(self, others: list[np.ndarray]) -> None:
        """Publish the map as the car has it."""
        self._maps.publish(grid_message(self._floor.seen(self.pose, others), "map", Time()))

    def step(self, seconds: float, others: list[np.ndarray]) -> None:
        """Drive on, be judged, and choose another goal where this one is reached."""
        driven = 0.0 if self._is_braking(others) else seconds * SPEED
        is_lost = len(self._plan) == 0
        self._without_path = self._without_path + seconds if is_lost else 0.0
        self._stood = self._stood + seconds if is_lost and not self._is_hemmed_in(others) else 0.0
        driven *= not is_lost
        if driven:
            self._curvature += (self._steered() - self._curvature) * min(1.0, seconds / STEERING_LAG)
            middle = self.pose[2] + driven * self._curvature / 2
            self.pose += driven * np.array([math.cos(middle), math.sin(middle), self._curvature])
        result = self.result
        result["seconds"] += seconds
        result["driven"] += driven
        result["standstill"] = max(result["standstill"], self._stood)
        result["without_path"] = max(result["without_path"], self._without_path)
        result["least_room"] = min(result["least_room"], self._floor.room(*self.pose[:2]) - BODY,
                                   *(math.dist(self.pose[:2], person[:2]) - BODY - PERSON for person in self._floor.people),
                                   *(math.dist(self.pose[:2], other[:2]) - 2 * BODY for other in others))
        self._judge_goal()

    def _judge_goal(self) -> None:
        goal, result = self._route[-1], self.result
        off = abs(math.remainder(self.pose[2] - goal[2], 2 * math.pi))
        at_goal = math.dist(self.pose[:2], goal[:2]) <= REACHED_XY and off <= REACHED_YAW
        result["reached"] = at_goal and (self._at > len(self._plan) - 20 or not result["waypoints"])
        if result["reached"] or result["seconds"] > PATIENCE:
            self.results.append({name: round(value, 3) if isinstance(value, float) else value for name, value in result.items()})
            print(json.dumps(self.results[-1]), flush=True)
            self.choose_goal()

    def _steered(self) -> float:
        """Return the curvature towards the point of the path that is a lookahead away (pure pursuit)."""
        x, y, yaw = self.pose
        path = self._plan
        ahead = path[self._at:self._at + 100]
        self._at += int(np.argmin(np.hypot(ahead[:, 0] - x, ahead[:, 1] - y)))
        lengths = np.cumsum(np.hypot(*np.diff(path[self._at:, :2], axis=0).T))
        if len(lengths) and lengths[-1] > LOOKAHEAD:
            tx, ty = path[self._at + 1 + int(np.searchsorted(lengths, LOOKAHEAD)), :2]
        else:
            beyond = LOOKAHEAD - (lengths[-1] if len(lengths) else 0.0)
            tx, ty = path[-1, 0] + beyond * math.cos(path[-1, 2]), path[-1, 1] + beyond * math.sin(path[-1, 2])
        across = -(tx - x) * math.sin(yaw) + (ty - y) * math.cos(yaw)
        curvature = 2 * across / max((tx - x) ** 2 + (ty - y) ** 2, 1e-6)
        return max(-MOST_CURVATURE, min(MOST_CURVATURE, curvature))

    def _is_hemmed_in(self, others: list[np.ndarray]) -> bool:
        """Return True if somebody is so near to the car, a waypoint or the goal that there may be no path."""
        somebody = [*self._floor.people[:, :2], *(other[:2] for other in others)]
        return any(math.dist(place[:2], body) < NEARBY for place in (self.pose, *self._route) for body in somebody)

    def _is_braking(self, others: list[np.ndarray]) -> bool:
        """Return True if the next metre of the path leads nearer to somebody who is near, as any driver sees.

        A car waits sooner for those before it: of two that meet one has to leave room for the other, as neither can back up.
        """
        with_way, places = others[:self._number - 1], [*self._floor.people[:, :2], *(other[:2] for other in others)]
        return self._leads_nearer(places, LOOK) or self._leads_nearer([other[:2] for other in with_way], LOOK_FOR_CARS)

    def _leads_nearer(self, places: list[np.ndarray], look: int) -> bool:
        ahead = self._plan[self._at:self._at + look, :2]
        if not len(ahead) or not places:
            return False
        now = np.hypot(*(self.pose[:2] - np.array(places)).T)
        least = np.hypot(*(ahead[:, None] - np.array(places)).T).min(axis=1)
        return bool(((least < BODY + PERSON + 0.05) & (least < now - 0.02)).any())


def drive(cars: list[Car], floor: Floor, executor: SingleThreadedExecutor, minutes: float) -> None:
    """Drive for that time."""
    while not all(car.is_connected for car in cars):
        executor.spin_once(timeout_sec=0.1)
    for car in cars:
        car.publish_map([])
        car.publish_pose()
        car.choose_goal()
    begin = now = time.monotonic()
    due_pose = due_map = begin
    while now < begin + 60 * minutes:
        executor.spin_once(timeout_sec=STEP)
        before, now = now, time.monotonic()
        floor.walk(min(now - before, 5 * STEP), [car.pose for car in cars])
        for car in cars:
            others = [other.pose for other in cars if other is not car]
            car.step(min(now - before, 5 * STEP), others)
            if now >= due_pose:
                car.publish_pose()
            if now >= due_map:
                car.publish_map(others)
        due_pose += POSE_PERIOD if now >= due_pose else 0.0
        due_map += MAP_PERIOD if now >= due_map else 0.0


def main() -> int:
    """Drive, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--map", default="maze", help="map file, or the name of an installed map")
    parser.add_argument("--robots", type=int, default=1)
    arguments = parser.parse_args()
    grid = load_map(find_map(arguments.map))
    if not isinstance(grid, GridMap):
        parser.error("give a map of cells")
    rngs = [np.random.default_rng((arguments.seed, number)) for number in range(arguments.robots + 1)]
    floor = Floor(grid, rngs[0])
    rclpy.init()
    executor = SingleThreadedExecutor()
    cars = [Car(number, floor, executor, rng) for number, rng in enumerate(rngs[1:], 1)]
    try:
        drive(cars, floor, executor, arguments.minutes)
    finally:
        for car in cars:
            car.planner.terminate()
            car.planner.wait()
        executor.shutdown()
        rclpy.try_shutdown()
    results = [result for car in cars for result in car.results]
    reached = [result for result in results if result["reached"]]
    touched = [result for result in (*results, *(car.result for car in cars)) if result["least_room"] < 0]
    summary = {"goals": len(results), "reached": len(reached), "touched": len(touched),
               "longest_standstill": max((result["standstill"] for result in results), default=0.0),
               "longest_without_path": max((result["without_path"] for result in results), default=0.0),
               "plans_a_second": round(sum(result["plans"] for result in results)
                                       / max(1.0, sum(result["seconds"] for result in results)), 2),
               "driven_over_shortest": round(sum(result["driven"] for result in reached)
                                             / max(1.0, sum(result.get("shortest", 0.0) for result in reached)), 3)}
    print(json.dumps(summary), flush=True)
    return 0 if reached and not summary["touched"] else 1


if __name__ == "__main__":
    sys.exit(main())
