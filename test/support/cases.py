"""Random maps and problems, and the naive twins applied to them."""

import importlib.util
import math
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pytest
import shapely

from dubins_rrt_ros.planning import GridMap, Path, PolygonMap, Problem, Vehicle, World, _kernels, kernels_compiled
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.search.cost import Objective
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.rrt import Search
from support import naive

#: By how much the budgets of the tests shrink where the kernels are interpreted, some fifty times slower.
SCALE = 1 if kernels_compiled else 20

needs_compiled = pytest.mark.skipif(not kernels_compiled, reason="takes minutes with interpreted kernels")


def scaled(count, least=1):
    """A budget as the kernels in use can bear it."""
    return max(least, count // SCALE)


def random_pose(rng, half_side=10.0):
    return (*rng.uniform(-half_side, half_side, 2).tolist(), rng.uniform(-math.pi, math.pi))


def boxes_grid(rng, side=40, resolution=0.25, boxes=8, unknown=False):
    """A turned grid with random boxes, and with unknown ones."""
    data = np.zeros((side, side + 5), np.int8)
    for value in [100] * boxes + [-1] * (3 if unknown else 0):
        row, column = rng.integers(0, side, 2)
        height, width = rng.integers(1, 6, 2)
        data[row:row + height, column:column + width] = value
    return GridMap(data, resolution, (*rng.uniform(-5, 5, 2), rng.uniform(-math.pi, math.pi)))


def maze_grid(rng, side=40, resolution=0.25):
    """A turned grid with walls across, each with a gap."""
    data = np.zeros((side, side), np.int8)
    for row in range(8, side - 4, 10):
        data[row] = 100
        gap = rng.integers(0, side - 8)
        data[row, gap:gap + 8] = 0
    return GridMap(data, resolution, (*rng.uniform(-5, 5, 2), rng.uniform(-math.pi, math.pi)))


def holed_polygons(rng, kind="boxes", side=10.0, count=8):
    """A square with random circles, boxes or walls taken out."""
    x, y = rng.uniform(0, side, (2, count))
    if kind == "circles":
        holes = shapely.buffer(shapely.points(x, y), rng.uniform(0.1, 0.9, count), quad_segs=5)
    elif kind == "boxes":
        width, height = rng.uniform(0.1, 1.5, (2, count))
        holes = shapely.box(x, y, x + width, y + height)
    else:
        gaps = rng.uniform(0, side - 2, 3)
        levels = side * np.array([0.25, 0.5, 0.75])
        holes = np.concatenate([shapely.box(-1, levels, gaps, levels + 0.1),
                                shapely.box(gaps + 2, levels, side + 1, levels + 0.1)])
    square = shapely.box(0, 0, side, side)
    return PolygonMap(square - shapely.union_all(holes))


def random_map(rng):
    """One of five kinds."""
    kind = rng.integers(5)
    if kind == 0:
        return boxes_grid(rng, unknown=True)
    if kind == 1:
        return maze_grid(rng)
    return holed_polygons(rng, ("circles", "boxes", "walls")[kind - 2])


@cache
def random_maps(count):
    """That many, the same ones in every test, so that each has its distance field computed once, by `world_of`."""
    rng = np.random.default_rng(count)
    return [random_map(rng) for _ in range(count)]


def naive_clearance(map, allow_unknown=False):
    """The naive twin of a map's clearance field: a function of (n, 2) points."""
    if isinstance(map, GridMap):
        values = map.data.astype(int)
        blocked = values >= 65 if allow_unknown else (values > 25) | (values < 0)
        return lambda points: naive.clearance_in_grid(points, blocked, map.resolution, map.origin)
    rings = [np.array(ring.coords) for part in shapely.get_parts(map.free) for ring in (part.exterior, *part.interiors)]
    return lambda points: naive.clearance_in_polygons(points, rings)


def free_pose(rng, map, clearance, need):
    """A random pose of a map with the clearance `need`, or with as much of it as 200 tries found."""
    corners = map.corners()
    points = corners[0] + rng.random((200, 2)) @ (corners[[1, 3]] - corners[0])
    found = clearance(points)
    enough = np.flatnonzero(found > need + 0.01)
    point = points[enough[0]] if len(enough) else points[np.argmax(found)]
    return (*point.tolist(), rng.uniform(-math.pi, math.pi))


@lru_cache(maxsize=64)
def world_of(map, allow_unknown):
    """The world that the vehicles on a map share the clearance of."""
    return World(map, Vehicle(), allow_unknown)


def random_problem(rng, map):
    """A problem on a prepared map with a random vehicle, and the naive clearance of the map."""
    allow_unknown = bool(rng.random() < 0.3)
    clearance = naive_clearance(map, allow_unknown)
    vehicle = Vehicle(turning_radius=rng.uniform(0.2, 1.2), robot_radius=rng.uniform(0, 0.4))
    start, goal = (free_pose(rng, map, clearance, vehicle.robot_radius) for _ in range(2))
    tolerance = {} if rng.random() < 0.6 else {
        "goal_tolerance_xy": rng.uniform(0, 0.5), "goal_tolerance_yaw": rng.uniform(0, 0.5),
        "any_goal_heading": bool(rng.random() < 0.3)}
    return Problem(world_of(map, allow_unknown).for_vehicle(vehicle), None, start, goal, **tolerance), clearance


def empty_map(side=20.0):
    """A square without obstacles around (0, 0)."""
    return GridMap(np.zeros((40, 40)), side / 40, (-side / 2, -side / 2, 0.0))


def field_of(problem):
    return world_of(problem.map, problem.allow_unknown).field


def search_on(problem, settings):
    """A search that has not begun."""
    field = field_of(problem)
    return Search(problem, settings, field, CostToGo.to_goal(problem, field, Objective.of(problem, settings, field)))


def steps_of(search):
    """The steps of a search, which without a path would go on for ever, up to its budget of samples."""
    for may_end in search.run():
        yield may_end
        if search.best < 0 and search.samples >= search._settings.samples:
            return


def finish(search):
    """The search, when it is done."""
    for _ in steps_of(search):
        pass
    return search


def contents(search):
    """All bytes of a search: its tree and its path."""
    names = ("poses", "parents", "costs", "words", "lengths")
    return [*(getattr(search.tree, name).tobytes() for name in names), search.path and search.path.poses(0.1).tobytes()]


def path_over(poses, radius):
    """The shortest curves from pose to pose."""
    return Path.of_curves(poses[0], poses[-1], [shortest(*pair, radius) for pair in pairwise(poses)])


def arrays_of(path):
    """All that a path is made of, as bytes."""
    return [array.tobytes() for array in (path.waypoints, path.words, path.lengths)]


def interpreted(name):
    """A kernel that calls no other one as the interpreter runs it, for functions that only kernels can call."""
    spec = importlib.util.spec_from_file_location(f"{_kernels.__name__}.interpreted_{name}",
                                                  FilePath(_kernels.__file__).with_name(f"{name}.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
