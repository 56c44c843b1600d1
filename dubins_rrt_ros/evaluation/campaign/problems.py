"""Random problems for `dubins_rrt campaign`, of many kinds; a seed and a number always give the same problem."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from dubins_rrt_ros.planning import FREE, OCCUPIED, UNKNOWN, GridMap, Map, Pose, Problem, Settings, Vehicle
from dubins_rrt_ros.planning.audit.edges import clearances
from dubins_rrt_ros.planning.audit.sweep import pose_gaps
from dubins_rrt_ros.planning.maps.model import DEFAULT_THRESHOLDS

from .maps import MAPS, log_uniform, placed, random_origin

#: Room to spare on either side of a vehicle that just passes, and width that one lacks that just fails [m].
TO_SPARE, LACKING = 0.0011, 2e-6
#: Gaps of poses that nearly touch an obstacle [m].
GAPS = 0.0, 1e-7, 1e-4, 4e-4, 6e-4, 0.001, 0.0011
#: Number of poses drawn at a time, among which free ones are chosen.
POSES = 40
#: Range of samples of most problems, and number for a few.
SAMPLES, MANY_SAMPLES = (20, 400), 3000
#: Time limit of most problems, which only a search without a path reaches, and range of that of some, which end with it [s].
AMPLE_TIME, SHORT_TIME = 1.0, (0.001, 0.05)
#: Share of the problems whose cells may have a cost, and range of its weight.
WITH_CELL_COSTS, CELL_WEIGHTS = 0.5, (0.1, 20.0)
#: Number of boxes of cells with a cost that are put on a grid, and share of a side that they take at most.
COST_BOXES, COST_BOX_SHARE = (1, 8), 0.6
#: Footprints with a circumscribed radius of about 1: x ahead of the reference point, y to its left.
OUTLINES = {
    "centred": [[1, 0.5], [-1, 0.5], [-1, -0.5], [1, -0.5]],
    "car": [[1, 0.25], [-0.25, 0.25], [-0.25, -0.25], [1, -0.25]],
    "thin": [[1, 0.01], [-0.5, 0.01], [-0.5, -0.01], [1, -0.01]],
    "bow": [[1, 0], [0.7, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.7, -0.3]],
    "L": [[0.7, 0.7], [0.2, 0.7], [0.2, 0.2], [-0.7, 0.2], [-0.7, -0.3], [0.7, -0.3]],
    "fork": [[1, 0.4], [-0.2, 0.4], [-0.2, -0.4], [1, -0.4], [1, -0.3], [0.25, -0.3], [0.25, 0.3], [1, 0.3]],
    "star": [[1, 0], [0.2, 0.2], [0, 1], [-0.2, 0.2], [-1, 0], [-0.2, -0.2], [0, -1], [0.2, -0.2]],
}


@dataclass(frozen=True)
class Trial:
    """A problem, its settings, and what is known of it.

    Attributes:
        kind: the name of its maker in KINDS.
        fits: True if the vehicle can drive the shortest curve from start to goal, False if there is no path, None if nothing is
            known.
    """

    kind: str
    problem: Problem
    settings: Settings
    fits: bool | None = None


def random_trial(seed: int, number: int) -> Trial:
    """Make the problem of this number."""
    rng = np.random.default_rng((seed, number))
    kind = str(rng.choice(list(KINDS), p=list(SHARES)))
    trial = replace(KINDS[kind](rng), kind=kind)
    # Drawn last, so that all problems without such costs are as they were before there were any.
    return _with_cell_costs(trial, rng) if rng.random() < WITH_CELL_COSTS else trial


def _with_cell_costs(trial: Trial, rng: np.random.Generator) -> Trial:
    """Return a problem with a weight of cells, and with boxes of such cells on a grid if the settings know them."""
    settings = replace(trial.settings, cost_weight=log_uniform(rng, *CELL_WEIGHTS))
    world_map, fits = trial.problem.map, trial.fits
    if not isinstance(world_map, GridMap) or settings.weight_of_cells == 0:
        return replace(trial, settings=settings)
    if world_map.with_costs(True) is not world_map and not fits:
        fits = None  # a wall of cells between the thresholds is none any more
    if trial.kind != "gap":  # whose way may lead exactly along the edges of cells, where it is rounding that decides
        trial = replace(trial, problem=replace(trial.problem, map=replace(world_map, data=_boxes_of_costs(world_map, rng))))
    return replace(trial, settings=settings, fits=fits)


def _boxes_of_costs(grid: GridMap, rng: np.random.Generator) -> np.ndarray:
    """Return the cells of a grid with values between the thresholds in some boxes, as far as they are free."""
    data, limits = grid.data.copy(), grid.thresholds
    for _ in range(rng.integers(*COST_BOXES)):
        row, column = (rng.integers(0, size) for size in data.shape)
        height, width = (rng.integers(1, max(2, math.ceil(COST_BOX_SHARE * size))) for size in data.shape)
        box = data[row:row + height, column:column + width]
        values = rng.integers(limits.free_up_to + 1, limits.occupied_from, box.shape if rng.random() < 0.5 else ())
        box[:] = np.where(limits.blocked(box, allow_unknown=False), box, values)
    return data


def random_settings(rng: np.random.Generator, scale: float) -> Settings:
    """Draw settings of all planners and samplers, mostly with few samples; limited steps are of about `scale` [m]."""
    hurried = rng.random() < 0.03
    samples = 100_000 if hurried else MANY_SAMPLES if rng.random() < 0.02 else int(log_uniform(rng, *SAMPLES))
    return Settings(
        planner=str(rng.choice(["rrt", "rrt_star"])), samples=samples, seed=int(rng.integers(2**31)),
        planning_time=log_uniform(rng, *SHORT_TIME) if hurried else AMPLE_TIME,
        step_size=scale * log_uniform(rng, 0.3, 10.0) if rng.random() < 0.4 else 0.0,
        goal_bias=float(rng.choice([0.0, 0.05, 0.3, 1.0], p=[0.1, 0.5, 0.3, 0.1])),
        heading_sampling=str(rng.choice(["uniform", "goal", "field", "mixed"])),
        informed=bool(rng.random() < 0.6), shortcut=bool(rng.random() < 0.6),
        # Drawn last, so that all else is as it was before there were costs.
        preferred_clearance=float(rng.choice([0.0, -1.0, scale * log_uniform(rng, 0.02, 0.5)], p=[0.5, 0.25, 0.25])),
        clearance_weight=log_uniform(rng, 0.2, 10.0))


def _on_map(make: Callable[[np.random.Generator], Map]) -> Callable[[np.random.Generator], Trial]:
    """Return a maker of problems on such maps, between free poses if there are any."""

    def make_trial(rng: np.random.Generator) -> Trial:
        world_map = make(rng)
        asked = Problem(world_map, Vehicle(), _some_pose(world_map, rng), _some_pose(world_map, rng),
                        allow_unknown=bool(rng.random() < 0.3))
        room = max(float(clearances(_poses(world_map, rng)[:, :2], asked).max()), 1e-3)
        asked = replace(asked, vehicle=_vehicle(rng, room), **_tolerances(rng, room))
        poses = _poses(world_map, rng)
        free = np.flatnonzero(pose_gaps(poses, asked) > 0)
        start, goal = poses[rng.choice(free if len(free) > 1 else POSES, 2, replace=False)].tolist()
        scale = max(asked.vehicle.turning_radius, _side(world_map) / 50)
        return Trial("", replace(asked, start=start, goal=goal), random_settings(rng, scale))

    return make_trial


def _anywhere(rng: np.random.Generator) -> Trial:
    """Make a problem between poses that may be in obstacles or outside the map."""
    trial = _any_map(rng)
    poses = _poses(trial.problem.map, rng, beyond=0.3)
    poses[:, 2] += math.tau * rng.integers(-1000, 1000, POSES)
    ends: dict[str, Any] = {name: poses[i].tolist() for i, name in enumerate(("start", "goal")) if rng.random() < 0.7}
    return replace(trial, problem=replace(trial.problem, **ends))


def _touching(rng: np.random.Generator) -> Trial:
    """Make a problem between poses at which the vehicle touches, or nearly touches, an obstacle."""
    trial = _any_map(rng)
    problem = trial.problem
    for name in ("start", "goal"):
        if rng.random() < 0.7:
            moved: dict[str, Any] = {name: _moved_up(problem, getattr(problem, name), float(rng.choice(GAPS)), rng)}
            problem = replace(problem, **moved)
    return replace(trial, problem=problem)


def _near(rng: np.random.Generator) -> Trial:
    """Make a problem whose goal is next to the start, or the start itself."""
    trial = _any_map(rng)
    x, y, theta = trial.problem.start
    away = log_uniform(rng, 1e-10, 1.0) * trial.problem.vehicle.turning_radius if rng.random() < 0.9 else 0.0
    bearing, turn = rng.uniform(-math.pi, math.pi), rng.choice([0.0, 1e-9, math.tau, log_uniform(rng, 1e-9, 1.0)])
    goal = x + away * math.cos(bearing), y + away * math.sin(bearing), theta + turn
    return replace(trial, problem=replace(trial.problem, goal=goal))


def _gap(rng: np.random.Generator) -> Trial:
    """Make a problem whose only way is straight through a gap that is just wide enough, or just not."""
    fits, width = bool(rng.random() < 0.5), log_uniform(rng, 0.05, 5.0)
    half = width / 2 - TO_SPARE if fits else width / 2 + LACKING / 2
    vehicle, size = _vehicle_of_half_width(rng, half)
    kind, origin = rng.choice(["grid", "polygons"]), random_origin(rng)
    cells = int(rng.integers(1, 5))
    thick = log_uniform(rng, 0.001, 2.0) * width if kind == "polygons" else int(rng.integers(1, 6)) * width / cells
    away = thick / 2 + size * rng.uniform(1.01, 2)
    sides = 2 * (away + 1.2 * size), 2 * rng.uniform(1.2, 3) * size + width
    world_map: Map
    if kind == "grid":
        wall = int(rng.choice([OCCUPIED, UNKNOWN, DEFAULT_THRESHOLDS.free_up_to + 1]))
        world_map = _gap_grid(width, cells, thick, sides, origin, wall)
    else:
        world_map = _gap_polygons(width, thick, sides, origin)
    problem = Problem(world_map, vehicle, _at(origin, -away, 0.0, 0.0), _at(origin, away, 0.0, 0.0))
    return Trial("", problem, random_settings(rng, size), fits)


def _gap_polygons(width: float, thick: float, sides: tuple[float, float], origin: Pose) -> Map:
    x, y = sides[0] / 2, sides[1] / 2
    walls = [shapely.box(-thick / 2, width / 2, thick / 2, y + 1), shapely.box(-thick / 2, -y - 1, thick / 2, -width / 2)]
    return placed(shapely.box(-x, -y, x, y) - shapely.union_all(walls), origin)


def _gap_grid(width: float, cells: int, thick: float, sides: tuple[float, float], origin: Pose, wall: int) -> Map:
    """Make a grid whose gap is `cells` wide; the cells of its walls hold the value `wall`."""
    resolution = width / cells
    through = round(thick / resolution)
    ahead, across = math.ceil(sides[0] / 2 / resolution), math.ceil(sides[1] / 2 / resolution)
    data = np.zeros((2 * across + cells, 2 * ahead + through), np.int8)
    data[:, ahead:ahead + through] = wall
    data[across:across + cells, ahead:ahead + through] = FREE
    corner = _at(origin, -(ahead + through / 2) * resolution, -(across + cells / 2) * resolution, 0.0)
    return GridMap(data, resolution, corner)


def _corner(rng: np.random.Generator) -> Trial:
    """Make a problem round a bend past a post that the outer corner or the inner side just clears, or just does not."""
    fits, outer, side = bool(rng.random() < 0.5), bool(rng.random() < 0.5), int(rng.choice([-1, 1]))
    half = log_uniform(rng, 0.05, 2.0)
    vehicle, size = _vehicle_of_half_width(rng, half, chamfered=False)
    radius = half + size * log_uniform(rng, 0.3, 5.0)
    vehicle = replace(vehicle, turning_radius=radius)
    farthest = max((abs(x) for x, _ in vehicle.footprint), default=0.0)
    gap = TO_SPARE if fits else -LACKING / 2
    away = math.hypot(farthest, radius + half) + gap if outer else radius - half - gap
    bearing, half_turn = rng.uniform(-math.pi, math.pi), rng.uniform(0.3, 1.4)
    origin = random_origin(rng)
    post = away * math.cos(bearing), away * math.sin(bearing)
    make: Callable[..., Map] = _post_grid if rng.random() < 0.5 else _post_polygons
    world_map = make(rng, post, bearing if outer else bearing + math.pi, 3 * radius + 3 * size, origin)
    # The centre of the turn is (0, 0) before everything is moved to the origin.
    angles = bearing - side * half_turn, bearing + side * half_turn
    start, goal = (_at(origin, radius * math.cos(a), radius * math.sin(a), a + side * math.pi / 2) for a in angles)
    return Trial("", Problem(world_map, vehicle, start, goal), random_settings(rng, size), True if fits else None)


def _post_polygons(rng: np.random.Generator, tip: tuple[float, float], bearing: float, half_side: float, origin: Pose) -> Map:
    """Make a map with a pointed post that extends from its tip in the direction of the bearing."""
    long = half_side * log_uniform(rng, 0.001, 0.01)
    ahead = np.array([math.cos(bearing), math.sin(bearing)])
    left = rng.uniform(0.05, 0.5) * np.array([-ahead[1], ahead[0]])
    post = shapely.Polygon([tip, tip + long * (ahead + left), tip + long * (ahead - left)])
    return placed(shapely.box(-half_side, -half_side, half_side, half_side) - post, origin)


def _post_grid(rng: np.random.Generator, tip: tuple[float, float], bearing: float, half_side: float, origin: Pose) -> Map:
    """Make a map with a single cell that extends from its corner, the tip, in the direction of the bearing."""
    cells = int(rng.integers(200, 400))
    resolution = 2 * half_side / cells
    data = np.zeros((cells, cells), np.int8)
    data[cells // 2, cells // 2] = OCCUPIED
    x, y, yaw = _at(origin, *tip, bearing - math.pi / 4)
    back = cells // 2 * resolution
    return GridMap(data, resolution, _at((x, y, yaw), -back, -back, 0.0))


def _vehicle_of_half_width(rng: np.random.Generator, half: float, chamfered: bool = True) -> tuple[Vehicle, float]:
    """Make a disc of this half-width, or a polygon around it; return the vehicle and its circumscribed radius [m]."""
    turning_radius = max(half * log_uniform(rng, 0.5, 5.0), 0.001)
    if rng.random() < 0.4:
        return Vehicle(turning_radius, half), half
    front, back = half * (1 + rng.uniform(0.5, 4.0)), half * (1 + rng.uniform(0.01, 2.0))
    cut = half * 0.2 if chamfered and rng.random() < 0.5 else 0.0
    nose = [[front - cut, half], [front, half - cut], [front, cut - half], [front - cut, -half]] if cut else [
        [front, half], [front, -half]]
    vehicle = Vehicle(turning_radius, footprint=_footprint([*nose, [-back, -half], [-back, half]]))
    return vehicle, vehicle.robot_radius


def _vehicle(rng: np.random.Generator, room: float) -> Vehicle:
    """Make a vehicle that has a chance of moving on a map whose largest clearance is about `room` [m]."""
    turning_radius = max(room * log_uniform(rng, 0.05, 3.0), 0.001)
    kind = rng.choice(["disc", "point", "polygon", "random polygon"], p=[0.35, 0.1, 0.4, 0.15])
    if kind in ("disc", "point"):
        return Vehicle(turning_radius, room * log_uniform(rng, 0.02, 0.9) if kind == "disc" else 0.0)
    if kind == "polygon":
        corners = np.array(OUTLINES[str(rng.choice(list(OUTLINES)))])
    else:  # around (0, 0) with no angle of half a turn, so that this is inside
        bearings = np.sort(rng.uniform(0, math.tau, 2)) + np.array([[0.0], [2.1], [4.2]]) + rng.uniform(0, math.tau)
        bearings = np.sort(np.unique(np.round(bearings.ravel() % math.tau, 3)))
        corners = np.column_stack([np.cos(bearings), np.sin(bearings)]) * rng.uniform(0.15, 1, (len(bearings), 1))
    return Vehicle(turning_radius, footprint=_footprint((room * log_uniform(rng, 0.05, 1.8) * corners).tolist()))


def _tolerances(rng: np.random.Generator, room: float) -> dict[str, Any]:
    """Draw the tolerances of the goal, mostly none."""
    if rng.random() < 0.7:
        return {}
    return {"goal_tolerance_xy": float(rng.choice([0.0, room * log_uniform(rng, 0.01, 1.0)])),
            "goal_tolerance_yaw": float(rng.choice([0.0, rng.uniform(0, math.pi)])), "any_goal_heading": bool(rng.random() < 0.3)}


def _any_map(rng: np.random.Generator) -> Trial:
    return _on_map(MAPS[str(rng.choice(list(MAPS)))])(rng)


def _side(world_map: Map) -> float:
    return float(np.ptp(world_map.corners(), axis=0).max())


def _some_pose(world_map: Map, rng: np.random.Generator) -> Pose:
    x, y, theta = _poses(world_map, rng)[0].tolist()
    return x, y, theta


def _poses(world_map: Map, rng: np.random.Generator, beyond: float = 0.0) -> np.ndarray:
    """Draw (POSES, 3) poses on a map, and outside it up to a share `beyond` of its sides."""
    corners = world_map.corners()
    shares = rng.uniform(-beyond, 1 + beyond, (POSES, 2))
    return np.column_stack([corners[0] + shares @ (corners[[1, 3]] - corners[0]), rng.uniform(-math.pi, math.pi, POSES)])


def _moved_up(problem: Problem, pose: Pose, gap: float, rng: np.random.Generator) -> Pose:
    """Move a pose in a random direction to where the vehicle has this gap, or hardly more."""
    bearing = rng.uniform(-math.pi, math.pi)

    def moved(by: float) -> Pose:
        return pose[0] + by * math.cos(bearing), pose[1] + by * math.sin(bearing), pose[2]

    near, far = 0.0, 2 * _side(problem.map)
    for _ in range(80):
        middle = (near + far) / 2
        near, far = (middle, far) if pose_gaps(np.array([moved(middle)]), problem)[0] > gap else (near, middle)
    return moved(near)


def _at(origin: Pose, x: float, y: float, theta: float) -> Pose:
    """Return the pose that has these coordinates in the frame of `origin`."""
    c, s = math.cos(origin[2]), math.sin(origin[2])
    return origin[0] + c * x - s * y, origin[1] + s * x + c * y, origin[2] + theta


def _footprint(corners: list[list[float]]) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in corners)


#: Functions that make problems, by kind, and the probability of each.
KINDS = {**{name: _on_map(make) for name, make in MAPS.items()}, "anywhere": _anywhere, "touching": _touching, "near": _near,
          "gap": _gap, "corner": _corner}
SHARES = [0.5 / len(MAPS)] * len(MAPS) + [0.06, 0.12, 0.06, 0.16, 0.1]
