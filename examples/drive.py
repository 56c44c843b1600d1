#!/usr/bin/env python3
"""Drive a simulated car with the node, in real time, on a map that changes: people walk through it, and some cells are wrong.

    examples/drive.py --minutes 5 --seed 1 [--map maze] [--robots 2]

The car follows `plan` by pure pursuit, with noise in its pose and lag in its steering. It is planned for with a radius 0.1 m
larger than its body. One line of JSON tells of each goal, and a last one of the whole drive; a judge that is not the planner
measures, from true poses, how near the body came to what was on the map. A path that the planner calls broken is not driven
on: the one in its place begins where the car was then. `without_path` is the longest time without a path to drive on,
`standstill` the longest in which the map that the planner had shows a way: that is planned again after the drive, with
JUDGING_TIME for each map; so people in the only way count for nothing, wherever they stand. The exit status is 1 if the car
touched anything or reached no goal: how long it stood still depends on how busy the machine is, too.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from course import Course
from diagnostic_msgs.msg import DiagnosticStatus
from floor import BODY, NO_ROOM, PERSON, Floor
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile

from dubins_rrt_ros.cli.demo.process import planner_command
from dubins_rrt_ros.node.conversions import grid_message, pose_message
from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, load_map, plan, prepare
from dubins_rrt_ros.planning.maps.locate import find_map

MARGIN, TURNING_RADIUS = 0.1, 1.0
VEHICLE = Vehicle(TURNING_RADIUS, BODY + MARGIN)
#: What the car can do: its speed [m/s], its curvature [1/m], and the time constant of its steering [s].
SPEED, MOST_CURVATURE, STEERING_LAG = 0.7, 1.25, 0.1
#: Distance along the path at which it is steered [m], and the standard deviations of its pose [m, rad].
LOOKAHEAD, NOISE_XY, NOISE_YAW = 0.5, 0.01, 0.01
#: Period of the simulation, of poses and of maps [s].
STEP, POSE_PERIOD, MAP_PERIOD = 0.02, 0.05, 0.5
#: Number of poses of the path that a driver looks ahead, and where a car has the right of way.
LOOK, LOOK_FOR_CARS = 25, 60
#: Maximum number of places that are tried for a goal.
MOST_TRIES = 50
#: Within this of the goal it is reached [m, rad]; a goal is given up after this time [s].
REACHED_XY, REACHED_YAW, PATIENCE = 0.25, 0.5, 180.0
#: Within this of the goal the path may end [m, rad]; a place is one only if ways lead on from it in directions off by SLANT, too.
TOLERANCE_XY, TOLERANCE_YAW, SLANT = 0.15, 0.3, 0.4
#: Time in which the judge looks for a path on a map without one, and in which one is sought between homes before the drive; and
#: the times without a path that are judged [s].
JUDGING_TIME, JUDGED = 3.0, 1.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PARAMETERS = {"robot_radius": BODY + MARGIN, "turning_radius": TURNING_RADIUS, "replan_on_map_change": True, "replan_rate": 2.0,
              "start_slack": MARGIN, "samples": 500, "planning_time": 0.5,
              "goal_tolerance_xy": TOLERANCE_XY, "goal_tolerance_yaw": TOLERANCE_YAW}


class View(NamedTuple):
    """What a planner knew at a time: seconds since the path was lost, the map, its pose, and where it is still to go to."""

    seconds: float
    grid: GridMap
    pose: tuple
    places: list[tuple]


@dataclass
class Wait:
    """A time without a path.

    Attributes:
        result: of the goal that was driven to.
        begin: when it began, by the clock of logs [s].
        seconds: how long it took [s].
        views: from its begin on, one for each map.
    """

    result: dict
    begin: float = field(default_factory=time.time)
    seconds: float = 0.0
    views: list[View] = field(default_factory=list)

    def judged(self) -> dict:
        """Return it with the longest time in it for which the maps showed a way [s]."""
        longest = stood = 0.0
        for view, end in zip(self.views, [*(view.seconds for view in self.views[1:]), self.seconds], strict=True):
            stood = stood + end - view.seconds if shows_way(view) else 0.0
            longest = max(longest, stood)
        pose, *places = ([round(float(a), 3) for a in place] for place in (self.views[0].pose, *self.views[0].places))
        return {"car": self.result["car"], "begin": round(self.begin, 3), "pose": pose, "places": places,
                "without_path": round(self.seconds, 3), "standstill": round(longest, 3)}


def shows_way(view: View) -> bool:
    """Return True if a way leads from the pose to each place in turn."""
    x, y, yaw = view.pose
    poses = [(x, y, math.remainder(yaw, math.tau)), *view.places]
    world = prepare(view.grid, VEHICLE)
    legs = [Problem(world, start=here, goal=there) for here, there in pairwise(poses)]
    legs[0] = replace(legs[0], start_slack=MARGIN)
    legs[-1] = replace(legs[-1], goal_tolerance_xy=TOLERANCE_XY, goal_tolerance_yaw=TOLERANCE_YAW)
    return all(plan(leg, Settings(planner="rrt", planning_time=JUDGING_TIME, seed=1)).solved for leg in legs)


class Places:
    """Random places on a floor without people, between which ways lead."""

    def __init__(self, floor: Floor, rng: np.random.Generator):
        self._floor, self._rng = floor, rng
        self._world = prepare(floor.grid, VEHICLE)

    def home(self) -> tuple[float, float, float]:
        """Return a pose from which a way leads to others, and back again."""
        for _ in range(MOST_TRIES):
            home, other = self._random_pose(0.6), self._random_pose(0.6)
            if self._leads(home, other, JUDGING_TIME) and self._leads(other, home, JUDGING_TIME):
                return home
        raise SystemExit(NO_ROOM)

    def after(self, here: tuple, home: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return a pose that a way leads to, and from which one leads home; home itself where none is found."""
        for _ in range(MOST_TRIES):
            place = self._random_pose(BODY + MARGIN + 0.15)
            if math.dist(here[:2], place[:2]) > 2.0 and self._leads(here, place) and self._leads(place, home):
                return place
        return home

    def _random_pose(self, room: float) -> tuple[float, float, float]:
        x, y = self._floor.random_place(room)
        return float(x), float(y), float(self._rng.uniform(-math.pi, math.pi))

    def _leads(self, start: tuple, goal: tuple, seconds: float = 0.3) -> bool:
        """Return True if a way leads from a place, which the car may have reached in another direction, to another one."""
        settings = Settings(planner="rrt", planning_time=seconds, seed=1)
        starts = [(*start[:2], math.remainder(start[2] + turn, math.tau)) for turn in (0.0, -SLANT, SLANT)]
        return all(plan(Problem(self._world, start=start, goal=goal), settings).solved for start in starts)


class Car:
    """A car with a planner of its own, in a namespace of its own."""

    def __init__(self, number: int, floor: Floor, executor: SingleThreadedExecutor, rng: np.random.Generator, log: Path | None):
        self._number, self._floor, self._rng = number, floor, rng
        self._places = Places(floor, rng)
        self.namespace = f"/car{number}"
        node = rclpy.create_node("car", namespace=self.namespace)
        executor.add_node(node)
        self._starts = node.create_publisher(PoseStamped, "start_pose", 1)
        self._routes = node.create_publisher(PoseArray, "goal_poses", 1)
        self._maps = node.create_publisher(OccupancyGrid, "map", LATCHED)
        node.create_subscription(PathMessage, "plan", self._on_plan, LATCHED)
        node.create_subscription(DiagnosticStatus, "planner/status", lambda message: self._course.hear(message), LATCHED)
        self._home = self._places.home()
        self.pose = np.array(self._home)
        self._last_place = self._home
        self._curvature = 0.0
        self._course = Course()
        self._route: list[np.ndarray] = []
        self.results: list[dict] = []  # of goals that ended
        self.result: dict = {}  # of the one that is driven to
        self._seen = floor.grid  # the map as it was published last
        self._believed = self._home  # the pose as it was published last
        self.waits: list[Wait] = []
        self._wait: Wait | None = None  # the present one
        rules = [part for name, value in PARAMETERS.items() for part in ("-p", f"{name}:={json.dumps(value)}")]
        # Last, so that no planner is left where the car cannot be placed.
        with open(log / f"car{number}.log" if log else os.devnull, "w") as file:
            self._planner = subprocess.Popen([*planner_command(), "--ros-args", "-r", f"__ns:={self.namespace}", *rules],
                                             stdout=file, stderr=subprocess.STDOUT)

    @property
    def is_connected(self) -> bool:
        """True once the planner hears all."""
        return all(topic.get_subscription_count() for topic in (self._starts, self._routes, self._maps))

    def stop(self) -> None:
        """End the planner."""
        self._planner.terminate()
        self._planner.wait()

    def _on_plan(self, message: PathMessage) -> None:
        self._course.take(message)
        self.result["plans"] += len(message.poses) > 0
        if message.poses and "shortest" not in self.result:
            self.result["shortest"] = self._course.length

    def choose_goal(self) -> None:
        """Ask for a path to a place, sometimes over another one."""
        places = [self._places.after(self._last_place, self._home)]
        if len(self.results) % 3 == 2:
            places.append(self._places.after(places[0], self._home))
        self._last_place = places[-1]
        self._route = [np.array(place) for place in places]
        self.result = {"car": self.namespace, "goal": [round(a, 3) for a in places[-1]], "waypoints": len(places) - 1,
                        "reached": False, "seconds": 0.0, "driven": 0.0, "plans": 0, "without_path": 0.0, "least_room": math.inf}
        self._course, self._wait = Course(), None
        message = PoseArray(poses=[pose_message(place) for place in places])
        message.header.frame_id = "map"
        self._routes.publish(message)

    def publish_pose(self) -> None:
        """Publish where the car believes to be."""
        self._believed = tuple(self.pose + self._rng.normal(0.0, (NOISE_XY, NOISE_XY, NOISE_YAW)))
        message = PoseStamped(pose=pose_message(self._believed))
        message.header.frame_id = "map"
        self._starts.publish(message)

    def publish_map(self, others: list[np.ndarray]) -> None:
        """Publish the map as the car has it."""
        self._seen = self._floor.seen(self.pose, others)
        self._maps.publish(grid_message(self._seen, "map", Time()))
        if self._wait:
            self._wait.views.append(self._view())

    def _view(self) -> View:
        assert self._wait
        return View(self._wait.seconds, self._seen, self._believed, [tuple(place) for place in self._route])

    def step(self, seconds: float, others: list[np.ndarray]) -> None:
        """Drive on, be judged, and choose another goal where this one is reached."""
        self._wait_for_path(seconds)
        driven = 0.0 if self._wait or self._is_braking(others) else seconds * SPEED
        if driven:
            self._curvature += (self._steered() - self._curvature) * min(1.0, seconds / STEERING_LAG)
            middle = self.pose[2] + driven * self._curvature / 2
            self.pose += driven * np.array([math.cos(middle), math.sin(middle), self._curvature])
        result = self.result
        result["seconds"] += seconds
        result["driven"] += driven
        result["without_path"] = max(result["without_path"], self._wait.seconds if self._wait else 0.0)
        result["least_room"] = min(result["least_room"], self._floor.room(*self.pose[:2]) - BODY,
                                   *(math.dist(self.pose[:2], person[:2]) - BODY - PERSON for person in self._floor.people),
                                   *(math.dist(self.pose[:2], other[:2]) - 2 * BODY for other in others))
        self._judge_goal()

    def _wait_for_path(self, seconds: float) -> None:
        if self._course.is_free:
            self._wait = None
            return
        if not self._wait:
            self._wait = Wait(self.result)
            self._wait.views.append(self._view())
            self.waits.append(self._wait)
        self._wait.seconds += seconds

    def _judge_goal(self) -> None:
        if len(self._route) > 1 and math.dist(self.pose[:2], self._route[0][:2]) < REACHED_XY:
            del self._route[0]
        goal, result = self._route[-1], self.result
        off = abs(math.remainder(self.pose[2] - goal[2], 2 * math.pi))
        at_goal = math.dist(self.pose[:2], goal[:2]) <= REACHED_XY and off <= REACHED_YAW
        result["reached"] = at_goal and (len(self._course.ahead) < 20 or not result["waypoints"])
        if result["reached"] or result["seconds"] > PATIENCE:
            self.results.append({name: round(value, 3) if isinstance(value, float) else value for name, value in result.items()})
            print(json.dumps(self.results[-1]), flush=True)
            if not result["reached"]:  # somebody carries it home
                self.pose, self._last_place = np.array(self._home), self._home
            self.choose_goal()

    def _steered(self) -> float:
        """Return the curvature towards the point of the path that is a lookahead away (pure pursuit)."""
        x, y, yaw = self.pose
        tx, ty = self._course.point_ahead(x, y, LOOKAHEAD)
        across = -(tx - x) * math.sin(yaw) + (ty - y) * math.cos(yaw)
        curvature = 2 * across / max((tx - x) ** 2 + (ty - y) ** 2, 1e-6)
        return max(-MOST_CURVATURE, min(MOST_CURVATURE, curvature))

    def _is_braking(self, others: list[np.ndarray]) -> bool:
        """Return True if the next metre of the path leads nearer to somebody who is near, as any driver sees.

        A car waits sooner for those before it: of two that meet one has to leave room for the other, as neither can back up.
        """
        with_way, places = others[:self._number - 1], [*self._floor.people[:, :2], *(other[:2] for other in others)]
        return self._leads_nearer(places, LOOK) or self._leads_nearer([other[:2] for other in with_way], LOOK_FOR_CARS)

    def _leads_nearer(self, places: list[np.ndarray], look: int) -> bool:
        ahead = self._course.ahead[:look, :2]
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
    parser.add_argument("--minutes", type=float, default=1.0, help="how long to drive; default 1")
    parser.add_argument("--seed", type=int, default=0, help="seed of the goals, the people and the noise; default 0")
    parser.add_argument("--map", default="maze", help="map file, or the name of an installed map; default maze")
    parser.add_argument("--robots", type=int, default=1, help="number of cars, each with a planner of its own; default 1")
    parser.add_argument("--log", type=Path, help="folder for the logs of the planners")
    arguments = parser.parse_args()
    grid = load_map(find_map(arguments.map))
    if not isinstance(grid, GridMap):
        parser.error("give a map of cells")
    rngs = [np.random.default_rng((arguments.seed, number)) for number in range(arguments.robots + 1)]
    floor = Floor(grid, rngs[0])
    if arguments.log:
        arguments.log.mkdir(parents=True, exist_ok=True)
    rclpy.init()
    executor = SingleThreadedExecutor()
    cars: list[Car] = []
    try:
        for number, rng in enumerate(rngs[1:], 1):
            cars.append(Car(number, floor, executor, rng, arguments.log))
        drive(cars, floor, executor, arguments.minutes)
    finally:
        for car in cars:
            car.stop()
        executor.shutdown()
        rclpy.try_shutdown()
    summary = summarise(cars)
    print(json.dumps(summary), flush=True)
    return 0 if summary["reached"] and not summary["touched"] else 1


def summarise(cars: list[Car]) -> dict:
    """Judge the times without a path that were long, with a line for each, and return the figures of the whole drive."""
    results = [result for car in cars for result in car.results]
    reached = [result for result in results if result["reached"]]
    touched = [result for result in (*results, *(car.result for car in cars)) if result["least_room"] < 0]
    waits = [wait.seconds for car in cars for wait in car.waits]
    judged = [wait.judged() for car in cars for wait in car.waits if wait.seconds > JUDGED]
    for wait in judged:
        print(json.dumps(wait), flush=True)
    short = [seconds for seconds in waits if seconds <= JUDGED]
    return {"goals": len(results), "reached": len(reached), "touched": len(touched),
            "longest_standstill": round(max([*short, *(wait["standstill"] for wait in judged)], default=0.0), 3),
            "longest_without_path": round(max(waits, default=0.0), 3),
            "plans_a_second": round(sum(result["plans"] for result in results)
                                    / max(1.0, sum(result["seconds"] for result in results)), 2),
            "driven_over_shortest": round(sum(result["driven"] for result in reached)
                                          / max(1.0, sum(result.get("shortest", 0.0) for result in reached)), 3)}


if __name__ == "__main__":
    sys.exit(main())
