"""Claims of certificates made false: each spoil takes a certificate, and gives one that does not hold, or hardly ever does."""

import copy
import math
from functools import cache, cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dubins_rrt_ros.checker.levels import FROM_START, HALF_CIRCLE, Squares
from dubins_rrt_ros.checker.maps import read_map
from dubins_rrt_ros.planning import GridMap, Problem, Vehicle, load_map, plan
from dubins_rrt_ros.planning.audit import audit_path
from dubins_rrt_ros.planning.curves.dubins import DubinsCurve
from dubins_rrt_ros.planning.curves.path import Path
from support.certificates import SETTINGS, Certified, saved

#: Distance between the poses along a path at which it is looked at [m].
STEP = 0.01


class Crossing(NamedTuple):
    """Where a path crosses a box: the gate, the box's row there, and the length of the path up to there [m]."""

    gate: int
    row: int
    along: float

    def box(self, document):
        """The box in a certificate."""
        return document["boxes"][self.gate][self.row]


class Drive:
    """The path of a certificate in the map's own frame, and what it crosses.

    Attributes:
        poses: (n, 3) poses, STEP apart.
        along: (n,) lengths up to them [m].
    """

    @classmethod
    @cache
    def of(cls, certified):
        """The drive of a certificate, once for all its spoils."""
        return cls(certified)

    def __init__(self, certified):
        self.document = certified.document
        self.world = read_map(certified.file, self.document["map"]["allow_unknown"])
        self.poses, self.along = _driven(self.document, self.world)

    @cached_property
    def squares(self):
        """The squares, where there are levels."""
        return Squares(self.document)

    @cached_property
    def gates(self):
        """The boxes of all poses in which gates are crossed."""
        return self.squares.gates()[0]

    def parts(self):
        """The rows, columns and slabs of the poses."""
        found = [self.squares.at(FROM_START, x, y) for x, y, _ in self.poses.tolist()]
        return np.column_stack([[square for square, _ in found], self.squares.slabs(np.array([cost for _, cost in found]))])

    def crossings(self):
        """The crossings of the boxes, in their order; none where a level is crossed more than once."""
        return self._crossings

    @cached_property
    def _crossings(self):
        if not self.document["levels"]:
            return []
        gates, found = self.gates, []
        before, after = self.poses[:-1, None, :2], self.poses[1:, None, :2]
        onward = np.stack([np.cos(gates[:, 6]), np.sin(gates[:, 6])], axis=1)
        height = [((points - gates[:, :2]) * onward).sum(axis=2) for points in (before, after)]
        share = ((before - gates[:, :2]) * gates[:, 2:4]).sum(axis=2) / gates[:, 4]
        crossed = (height[0] < 0) & (height[1] >= 0) & (np.abs(share) <= 1)
        for pose, gate in zip(*(index.tolist() for index in np.nonzero(crossed)), strict=True):
            off = math.remainder(self.poses[pose, 2] - gates[gate, 6], math.tau) / HALF_CIRCLE
            found += [Crossing(gate, row, float(self.along[pose + 1])) for row, box in enumerate(self.document["boxes"][gate])
                      if box[0] + 0.02 < share[pose, gate] < box[1] - 0.02 and box[2] <= off <= box[3]]
        levels = [gates[crossing.gate, 9] for crossing in found]
        return found if levels == sorted(set(levels)) else []

    def open_crossings(self):
        """The crossings before which all boxes that are crossed leave a path the chance to be short enough."""
        for crossing in self.crossings():
            yield crossing
            potential = crossing.box(self.document)[4]
            if potential is None or potential + self.gates[crossing.gate, 10] >= self.document["bound"]:
                return


def _driven(document, world):
    poses, lengths = [np.array([world.own(document["request"]["start"])])], [np.zeros(1)]
    for word, radius, metres in document["path"]:
        x, y, heading = poses[-1][-1]
        s = np.linspace(0, metres, math.ceil(metres / STEP) + 1)[1:]
        bend = {"L": 1, "S": 0, "R": -1}[word] / radius
        towards, chord = heading + bend * s / 2, s * np.sinc(bend * s / math.tau)
        poses.append(np.column_stack([x + chord * np.cos(towards), y + chord * np.sin(towards), heading + bend * s]))
        lengths.append(lengths[-1][-1] + s)
    return np.concatenate(poses), np.concatenate(lengths)


def _with(certified, change, *arguments):
    document = copy.deepcopy(certified.document)
    change(document, *arguments)
    return Certified(document, certified.file)


def _raised_bound(certified, rng, folder):
    def change(document):
        document["bound"] *= 1.0001
    return _with(certified, change)


def _bound_above_the_path(certified, rng, folder):
    def change(document):
        document["bound"] = 1.0001 * document["length"]
    return _with(certified, change)


def _raised_potential(certified, rng, folder):
    """The potential of a box that the path crosses, raised above what the path has behind it there."""
    found = [crossing for crossing in Drive.of(certified).open_crossings() if crossing.box(certified.document)[4] is not None]
    if not found:
        return None
    crossing = found[rng.integers(len(found))]

    def change(document):
        crossing.box(document)[4] = 1.0001 * crossing.along
    return _with(certified, change)


def _raised_potentials(certified, rng, folder):
    """All potentials on a level, raised by a thousandth of the bound."""
    if not any(certified.document["boxes"]):
        return None
    costs = Drive.of(certified).gates[:, 9]
    level = rng.choice([cost for cost, boxes in zip(costs, certified.document["boxes"], strict=True) if boxes])

    def change(document):
        for gate in np.flatnonzero(costs == level):
            for box in document["boxes"][gate]:
                box[4] = None if box[4] is None else box[4] + 0.001 * document["bound"]
    return _with(certified, change)


def _on_path(certified, rng, change):
    """The certificate after a change of a gate's boxes, of which the path crosses that of a row; None where it crosses none."""
    found = Drive.of(certified).crossings()
    if not found:
        return None
    crossing = found[rng.integers(len(found))]
    return _with(certified, lambda document: change(document["boxes"][crossing.gate], crossing.row))


def _dropped_box(certified, rng, folder):
    return _on_path(certified, rng, lambda boxes, row: boxes.pop(row))


def _shortened_box(certified, rng, folder):
    """A box that the path crosses, without a thousandth at one of its ends."""
    def change(boxes, row):
        end = int(rng.integers(4))
        boxes[row][end] += (-0.001, 0.001)[end % 2 == 0]
    return _on_path(certified, rng, change)


def _closed_box(certified, rng, folder):
    """A box that the path crosses, said to hold no free place."""
    def change(boxes, row):
        boxes[row][4] = None
    return _on_path(certified, rng, change)


def _left_out_square(certified, rng, folder):
    """The corridor leaks: a square that the path leads through is left out."""
    if not certified.document["levels"]:
        return None
    up, across, _ = rng.choice(Drive.of(certified).parts())

    def change(document):
        free = document["squares"]["free"]
        free[up] = free[up][:across] + "0" + free[up][across + 1:]
    return _with(certified, change)


def _parted_cell(certified, rng, folder):
    """A cell is cut in two between two squares of the path."""
    if not certified.document["levels"]:
        return None
    drive = Drive.of(certified)
    parts = drive.parts()
    steps = np.flatnonzero((parts[1:, :2] != parts[:-1, :2]).any(axis=1) & (parts[1:, 2] == parts[:-1, 2]))
    if not len(steps):
        return None
    row, column, slab = parts[rng.choice(steps)]
    numbers = np.cumsum(drive.squares.parts).reshape(drive.squares.parts.shape) - 1

    def change(document):
        document["cells"][numbers[slab, row, column]] = 1_000_000
    return _with(certified, change)


def _swapped_levels(certified, rng, folder):
    if len(certified.document["levels"]) < 2:
        return None

    def change(document):
        levels = document["levels"]
        levels[0], levels[-1] = levels[-1], levels[0]
    return _with(certified, change)


def _swapped_potentials(certified, rng, folder):
    """The potentials of two boxes that the path crosses one after the other."""
    found = list(Drive.of(certified).open_crossings())
    pairs = [(one, other) for one, other in pairwise(found)
             if None not in (potentials := [crossing.box(certified.document)[4] for crossing in (one, other)])
             and potentials[1] > 1.0001 * one.along]
    if not pairs:
        return None
    one, other = pairs[rng.integers(len(pairs))]

    def change(document):
        box, following = one.box(document), other.box(document)
        box[4], following[4] = following[4], box[4]
    return _with(certified, change)


def _too_near(certified, rng, folder):
    """A vehicle that comes 2 mm too near to an obstacle."""
    if certified.document["request"]["footprint"]:
        return None
    drive = Drive.of(certified)

    def change(document):
        document["request"]["robot_radius"] = float(drive.world.clearances(drive.poses[:, :2], np.inf).min()) + 0.002
    return _with(certified, change)


def _larger_radius(certified, rng, folder):
    if all(word == "S" for word, _, _ in certified.document["path"]):
        return None

    def change(document):
        document["request"]["turning_radius"] *= 1.001
    return _with(certified, change)


def _steeper(certified, rng, folder):
    if not certified.document["levels"]:
        return None

    def change(document):
        document["from_start"] = [[None if cost is None else 1.01 * cost for cost in row] for row in document["from_start"]]
    return _with(certified, change)


def _raised_node(certified, rng, folder):
    """A cost to the goal beside the path, raised by more than that of two places across a square can differ."""
    if not certified.document["levels"]:
        return None
    row, column, _ = rng.choice(Drive.of(certified).parts())

    def change(document):
        document["to_goal"][row][column] += 2.5 * document["squares"]["side"]
    return _with(certified, change)


def _narrow(certified, rng, folder):
    def change(document):
        document["limit"] = document["bound"] * rng.uniform(0, 1)
    return _with(certified, change) if certified.document["levels"] else None


def _on(certified, folder, change):
    """The certificate for a map whose cells were changed, its hash made anew; None for polygons."""
    grid = load_map(certified.file)
    if not isinstance(grid, GridMap):
        return None
    data = grid.data.copy()
    change(grid, data)
    document = copy.deepcopy(certified.document)
    file = saved(GridMap(data, grid.resolution, grid.origin, percent=True), folder / "changed")
    allow_unknown = document["map"]["allow_unknown"]
    document["map"] = read_map(file, allow_unknown).description | {"allow_unknown": allow_unknown}
    return Certified(document, file)


def _walled(certified, rng, folder):
    """A wall in the middle of the vehicle, somewhere on its path."""
    def change(grid, data):
        poses = Drive.of(certified).poses
        x, y, heading = poses[rng.integers(len(poses))]
        ahead = np.mean(certified.document["request"]["footprint"] or [(0.0, 0.0)], axis=0)[0]
        data[int((y + ahead * math.sin(heading)) / grid.resolution), int((x + ahead * math.cos(heading)) / grid.resolution)] = 100
    return _on(certified, folder, change)


def _opened(certified, rng, folder):
    """No obstacle is left."""
    def change(grid, data):
        data[:] = 0
    return _on(certified, folder, change) if certified.document["levels"] else None


def _opened_beside(certified, rng, folder):
    """The obstacle that the path comes nearest to is taken away."""
    def change(grid, data):
        rows, columns = np.nonzero(data >= 65)
        if len(rows):
            points = (np.column_stack([columns, rows]) + 0.5) * grid.resolution
            poses = Drive.of(certified).poses[::4, None, :2]
            nearest = np.hypot(*(poses - points).transpose(2, 0, 1)).min(axis=0).argmin()
            data[rows[nearest], columns[nearest]] = 0
    return _on(certified, folder, change) if certified.document["levels"] else None


#: Spoils whose claim, or a part of its argument, is false.
FALSE = {
    "bound above the path": _bound_above_the_path, "potential above the path": _raised_potential, "box dropped": _dropped_box,
    "box shortened": _shortened_box, "box closed": _closed_box, "square left out": _left_out_square, "cell parted": _parted_cell,
    "levels swapped": _swapped_levels, "potentials swapped": _swapped_potentials, "2 mm too near": _too_near,
    "R + 0.1 %": _larger_radius, "costs too steep": _steeper, "node raised": _raised_node, "corridor too narrow": _narrow,
    "wall added": _walled, "walls removed": _opened}
#: Spoils that can leave a claim true.
DOUBTFUL = {"bound + 0.01 %": _raised_bound, "potentials of a level raised": _raised_potentials, "wall removed": _opened_beside}
SPOILS = FALSE | DOUBTFUL


def is_true(certified, settings=SETTINGS):
    """True unless a claim is known to be false: by the planner's audit of the path, or a path that is shorter than the bound."""
    document, world_map = certified.document, load_map(certified.file)
    request = document["request"]
    radius, footprint = request["turning_radius"], request["footprint"]
    vehicle = (Vehicle.from_footprint(footprint, turning_radius=radius) if footprint
               else Vehicle(turning_radius=radius, robot_radius=request["robot_radius"]))
    problem = Problem(world_map, vehicle, request["start"], request["goal"], allow_unknown=document["map"]["allow_unknown"],
                      goal_tolerance_xy=request["goal_tolerance_xy"], goal_tolerance_yaw=request["goal_tolerance_yaw"])
    path = _path(document)
    best = plan(problem, settings).path
    return audit_path(path, problem).ok and min(path.length, best.length if best else math.inf) >= document["bound"]


def _path(document):
    """The path as the library has it: one curve for each arc."""
    curves, start = [], tuple(document["request"]["start"])
    for word, radius, metres in document["path"]:
        curve = DubinsCurve(start, radius, {"L": "LSL", "S": "LSL", "R": "RSR"}[word],
                            (0.0, metres, 0.0) if word == "S" else (metres, 0.0, 0.0))
        curves.append(curve)
        start = curve.end
    return Path.of_curves(tuple(document["request"]["start"]), start, curves)
