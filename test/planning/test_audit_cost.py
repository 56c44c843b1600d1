"""The audit's measure of a path's cost, against integrals that are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from dubins_rrt_ros.planning import GridMap, PolygonMap, Problem, Settings, Vehicle
from dubins_rrt_ros.planning.audit import cost_of, roomy_share_of
from dubins_rrt_ros.planning.curves.dubins import DubinsCurve
from dubins_rrt_ros.planning.curves.path import Path
from dubins_rrt_ros.planning.maps.model import Thresholds

ORIGIN = (1.0, -2.0, 0.4)
DISC = Vehicle(turning_radius=1.0, robot_radius=0.3)
CAR = Vehicle.from_footprint([[0.5, 0.3], [-0.2, 0.3], [-0.2, -0.3], [0.5, -0.3]], turning_radius=1.0)
PREFERRED, WEIGHT = 0.5, 3.0
SETTINGS = Settings(preferred_clearance=PREFERRED, clearance_weight=WEIGHT)


def hall(kind):
    """A hall of 20 x 4 m above a wall of 0.4 m, as a turned grid or as polygons."""
    if kind == "polygons":
        return PolygonMap.of(shapely.box(0, 0.4, 20, 4.4))
    data = np.zeros((22, 100), np.int8)
    data[:2] = 100
    return GridMap(data, 0.2, ORIGIN)


def pose_in(world_map, x, y, yaw):
    if isinstance(world_map, PolygonMap):
        return x, y, yaw
    return *world_map.to_map_frame(np.array([x, y])).tolist(), yaw + world_map.origin[2]


def straight(start, length, radius=1.0):
    curve = DubinsCurve(start, radius, "LSL", (0.0, length, 0.0))
    return Path.of_curves(start, curve.end, [curve])


@pytest.mark.parametrize("kind", ["grid", "polygons"])
@pytest.mark.parametrize("vehicle", [DISC, CAR], ids=["disc", "car"])
@pytest.mark.parametrize("room", [0.05, 0.2, 0.6])
def test_along_a_wall_a_metre_costs_what_the_room_says(kind, vehicle, room):
    world_map = hall(kind)
    path = straight(pose_in(world_map, 2.0, 0.7 + room, 0.0), 17.0)
    problem, closeness = Problem(world_map, vehicle, path.start, path.end), max(0.0, 1 - room / PREFERRED)
    assert cost_of(path, problem, SETTINGS) == pytest.approx(17.0 * (1 + WEIGHT * closeness**2), rel=1e-6)
    assert roomy_share_of(path, problem, SETTINGS) == pytest.approx(float(room >= 0.8 * PREFERRED))


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_away_from_a_wall_the_cost_is_the_integral(kind):
    world_map, angle = hall(kind), 0.03
    path = straight(pose_in(world_map, 2.0, 0.7, angle), 16.0)
    problem = Problem(world_map, DISC, path.start, path.end)
    reach = PREFERRED / math.sin(angle)  # length up to where the room is as much as is preferred
    closeness = (reach - (reach - 16.0 if reach > 16 else 0.0)**3 / reach**2) / 3
    assert cost_of(path, problem, SETTINGS) == pytest.approx(16.0 + WEIGHT * closeness, rel=1e-5)
    assert roomy_share_of(path, problem, SETTINGS) == pytest.approx(1 - 0.8 * reach / 16, abs=1e-3)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
@pytest.mark.parametrize("radius", [0.02, 0.5])
def test_where_a_footprint_turns_nearly_on_the_spot_the_cost_is_the_integral_of_how_its_corners_move(kind, radius):
    world_map, vehicle = hall(kind), Vehicle(radius, footprint=CAR.footprint)
    curve = DubinsCurve(pose_in(world_map, 6.0, 1.1, 0.3), radius, "LSL", (0.9 * radius, 0.0, 0.0))
    path = Path.of_curves(curve.start, curve.end, [curve])
    turns = 0.3 + 0.9 * (np.arange(100_000) + 0.5) / 100_000
    y = 1.1 + radius * (math.cos(0.3) - np.cos(turns))
    corners = np.array(vehicle.footprint)
    room = (y + (np.sin(turns) * corners[:, :1] + np.cos(turns) * corners[:, 1:]).min(axis=0)) - 0.4
    assert 0 < room.min() < PREFERRED
    closeness = float((np.maximum(0, 1 - room / PREFERRED)**2).mean())
    problem = Problem(world_map, vehicle, path.start, path.end)
    assert cost_of(path, problem, SETTINGS) == pytest.approx(path.length * (1 + WEIGHT * closeness), rel=1e-4)


@pytest.mark.parametrize("length", [0.21, 0.7, 58.0])
def test_the_cost_of_cells_is_their_integral_along_the_path(length):
    rng = np.random.default_rng(1)
    thresholds = Thresholds.of_fractions(free_thresh=0.0, occupied_thresh=0.995)
    data = rng.integers(1, 99, (20, 300)).astype(np.int8)
    grid = GridMap(data, 0.2, ORIGIN, percent=True, thresholds=thresholds).with_costs(True)
    settings = Settings(preferred_clearance=0.0, cost_weight=2.0)
    for y in (0.31, 0.35, 0.42):
        path = straight(pose_in(grid, 0.53, y, 0.05), length)
        cells = np.floor(grid.to_grid_frame(path.at((np.arange(400_000) + 0.5) / 400_000)[:, :2]) / grid.resolution).astype(int)
        integral = float(grid.costs[cells[:, 1], cells[:, 0]].mean()) / 100 * length
        problem = Problem(grid, DISC, path.start, path.end)
        assert cost_of(path, problem, settings) - length == pytest.approx(2 * integral, rel=1e-4)
        assert cost_of(path, problem, replace(settings, informed=False)) == length


def test_without_a_preference_or_a_length_there_is_no_share_of_room():
    world_map = hall("grid")
    path, pose = straight(pose_in(world_map, 2.0, 2.0, 0.0), 5.0), Path.of_pose(pose_in(world_map, 2.0, 2.0, 0.0))
    problem = Problem(world_map, DISC, path.start, path.end)
    assert roomy_share_of(path, problem, Settings(preferred_clearance=0.0)) is None
    assert roomy_share_of(pose, problem, SETTINGS) is None and cost_of(pose, problem, SETTINGS) == 0.0
    assert cost_of(path, problem, Settings(preferred_clearance=0.0)) == 5.0
