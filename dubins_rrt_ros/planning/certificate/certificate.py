"""Make a certificate: the path, and the proof that no path is much shorter."""

import gzip
import json
import time
from collections.abc import Callable
from itertools import compress
from pathlib import Path as File
from typing import Any

import numpy as np
import shapely
from scipy import ndimage

from ...checker.bounds import too_high
from ...checker.check import goal_boxes, inner_radius, margin_of, ways
from ...checker.levels import FROM_START, TO_GOAL, Squares
from ...checker.maps import UnreadableMap, digest_of_cells, read_map
from ...checker.maps import World as CheckedMap
from .._kernels import UNLIMITED
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..deadline import OutOfTime
from ..errors import PlanningError
from ..maps.model import GridMap
from ..problem import Problem
from ..proof.length_proof import GAPS, LengthProof
from .bisection import Bisection
from .cover import Cover, Ends
from .potentials import Potentials

#: Share by which more than the length is proved at first, for what the margins of potentials take.
SLACK = 1e-8
#: Share of the time for the choice of levels.
LEVELS_SHARE = 0.2
#: What stands for the cell where a square has no part in a slab.
NONE = -1


class CertificateError(PlanningError, ValueError):
    """A request whose path cannot be certified; the message says why."""


def checked_map(problem: Problem, map_path: str | File) -> CheckedMap:
    """Return the map of a problem as the checker reads it, if the problem's paths can have a certificate.

    Args:
        map_path: a map_server YAML file, or polygons.

    Raises:
        CertificateError: the map is not as the checker reads it, or the request is of a kind that has no certificates.
    """
    if problem.start_slack > 0:
        raise CertificateError("a start that is nearer to an obstacle than allowed has no certificate; leave start_slack out")
    try:
        world = read_map(map_path, problem.allow_unknown)
    except UnreadableMap as error:
        raise CertificateError(f"the checker cannot read the map: {error}") from None
    grid = problem.map
    if isinstance(grid, GridMap):
        same = world.description.get("sha256") == digest_of_cells(grid.data) and world.description["origin"] == list(grid.origin)
    else:
        same = world.free is not None and bool(shapely.equals(world.free, grid.free))
    if not same:
        raise CertificateError(f"the checker of certificates reads {map_path} by map_server's rules, which give another map than "
                               "this one; leave unknown_grey out")
    return world


def certify(problem: Problem, path: Path, world: CheckedMap, gap: float, seconds: float,
            field: ClearanceField | None = None) -> dict[str, Any]:
    """Return the certificate of a path.

    Args:
        problem: what the path solves.
        world: the problem's `checked_map`.
        gap: share by which the path may be longer than the shortest, down to which the bound is to be raised.
        seconds: approximate time for it.
        field: the clearance of the map, where it is at hand.
    """
    begin = time.perf_counter()
    document = _claim(problem, path, world)
    proved = _without_obstacles(document, world)
    if inner_radius(document["request"]) > 0 and path.length > (1 + gap) * proved["bound"]:
        proof = LengthProof(problem, field or ClearanceField(problem.map, problem.allow_unknown), path)
        proof.run(lambda: time.perf_counter() > begin + LEVELS_SHARE * seconds, gap)
        if proof.sets.end > 0:
            draft = _Draft(document, world, proof)
            proved = draft.proved(gap, proved["bound"], lambda: time.perf_counter() > begin + seconds) or proved
    return document | proved


def _without_obstacles(document: dict[str, Any], world: CheckedMap) -> dict[str, Any]:
    """Return the proof by the Dubins curves alone, where the vehicle covers no disc around its reference point."""
    request, length = document["request"], document["length"]
    start, goal = (world.own(request[name]) for name in ("start", "goal"))
    margin = margin_of(document | {"limit": length}, world)
    goals = goal_boxes(goal, request["goal_tolerance_xy"], request["goal_tolerance_yaw"], length, margin)
    box = goal_boxes(start, 0, 0, 0, margin)
    bound = length - 2 * margin - float(too_high(box, goals, request["turning_radius"], 2 * margin).max())
    return {"bound": max(0.0, bound), "limit": length, "levels": [], "cells": [], "boxes": [],
            "squares": {"corner": [0, 0], "side": 1, "free": []}, "from_start": [], "to_goal": []}


def _claim(problem: Problem, path: Path, world: CheckedMap) -> dict[str, Any]:
    """Return what a certificate says of map, request and path."""
    vehicle = problem.vehicle
    return {
        "certificate": 1, "map": world.description | {"allow_unknown": problem.allow_unknown},
        "request": {"start": list(problem.start), "goal": list(problem.goal), "goal_tolerance_xy": problem.goal_tolerance_xy,
                    "goal_tolerance_yaw": problem.yaw_tolerance, "turning_radius": vehicle.turning_radius,
                    "robot_radius": vehicle.robot_radius, "footprint": [list(corner) for corner in vehicle.footprint]},
        "path": [[letter, curve.radius, length] for curve in path.curves
                 for letter, length in zip(curve.word, curve.lengths, strict=True) if length > 0],
        "length": path.length}


class _Draft:
    """The proof of a certificate that is being made."""

    def __init__(self, document: dict[str, Any], world: CheckedMap, proof: LengthProof):
        self._world, self._request, self._length = world, document["request"], float(document["length"])
        self._inner = inner_radius(document["request"])
        sets = proof.sets
        side = sets.side
        free = sets.is_free & _full(sets.from_start) & _full(sets.to_goal)
        from_start, to_goal = (np.where(_touched(free), nodes, np.nan) for nodes in (sets.from_start, sets.to_goal))
        levels = proof.levels if len(proof.levels) else np.array([sets.end / 2])
        while np.isin(levels, from_start).any():
            levels = np.where(np.isin(levels, from_start), np.nextafter(levels, 0), levels)
        self._document: dict[str, Any] = {
            "limit": self._length * (1 + 1e-6) + 2 * side, "levels": levels.tolist(),
            "squares": {"corner": [-side, -side], "side": side,
                        "free": ["".join("01"[is_free] for is_free in row) for row in free.tolist()]},
            "from_start": _rows(from_start), "to_goal": _rows(to_goal)}
        self._squares = Squares(self._document)
        self._cells = _labelled(self._squares.parts)
        self._margin = margin_of(document | self._document, world)

    def proved(self, gap: float, bound: float, is_over: Callable[[], bool]) -> dict[str, Any] | None:
        """Return the fields of the proof with the greatest bound that there is time for, if it is above `bound` [m].

        Args:
            gap: share by which the path may be above the bound that is good enough.
        """
        cover, radius = self._cover(), float(self._request["turning_radius"])
        bisection, boxes = Bisection(cover, radius), None
        # Further ones than that of the gap, as the checker's bounds of curves are lower than those by which boxes are halved.
        targets = sorted(self._length / (1 + share) * (1 + SLACK) for share in (*GAPS, gap))
        for target in (target for target in targets if target > bound):
            if self._length <= (1 + gap) * bound:
                break
            bisection.run(target, is_over)
            try:
                potentials = Potentials(cover, radius, bisection.bound, is_over)
            except OutOfTime:
                break
            if potentials.bound > bound:
                bound, boxes = potentials.bound, cover.document(potentials.values)
            if bisection.bound < target:
                break
        cells = self._cells[self._squares.parts].tolist()
        return None if boxes is None else self._document | {"bound": bound, "cells": cells, "boxes": boxes}

    def _cover(self) -> Cover:
        (gates, *parts), ends = self._squares.gates(), self._ends()
        keys = list(zip(*(self._cells[*some.T].tolist() for some in parts), strict=True))
        portals = sorted(set(keys))
        used = compress(portals, np.asarray(ways(np.array(portals), ends.start_cell, ends.goal_cells).any(axis=0)))
        return Cover(gates, keys, list(used), ends, self._is_blocked, self._margin)

    def _ends(self) -> Ends:
        start, goal = (self._world.own(self._request[name]) for name in ("start", "goal"))
        start_cell, cost = self._cell_at(start)
        tolerance, squares = self._request["goal_tolerance_xy"], self._squares
        goals = goal_boxes(goal, tolerance, self._request["goal_tolerance_yaw"], 0.0, self._margin)
        if tolerance == 0:
            goal_cell, goals[:, 9] = self._cell_at(goal)
            cells, excess = {goal_cell}, squares.at(TO_GOAL, *goal[:2])[1]
        else:
            near = squares.near(*goal[:2], tolerance + 2 * self._margin)
            cells = set(self._cells[:, near].ravel().tolist()) - {NONE}
            excess = float(squares.corners[TO_GOAL][near & squares.domain].max())
        start_box = goal_boxes(start, 0, 0, 0, self._margin)
        start_box[:, 9] = cost
        return Ends(start_box, goals, start_cell, cells, max(0.0, excess))

    def _cell_at(self, pose: tuple[float, float, float]) -> tuple[int, float]:
        """Return the cell of a place, and its cost from the start [m]."""
        square, cost = self._squares.at(FROM_START, *pose[:2])
        return int(self._cells[int(self._squares.slabs(cost)), *square]), cost

    def _is_blocked(self, boxes: np.ndarray) -> np.ndarray:
        return self._world.clearances(boxes[:, :2], self._inner) + boxes[:, 4] * (1 + 1e-9) + 1e-9 < self._inner


def _labelled(parts: np.ndarray) -> np.ndarray:
    """Return the cell of each part of a square in a slab: those that touch within a slab hang together; NONE elsewhere."""
    cells, count = np.full(parts.shape, NONE), 0
    for some, mask in zip(cells, parts, strict=True):
        labels, found = ndimage.label(mask, np.ones((3, 3)))
        some[mask] = labels[mask] + count
        count += found
    return cells


def write_certificate(file: str | File, document: dict[str, Any]) -> None:
    """Write a certificate, compressed."""
    File(file).write_bytes(gzip.compress(json.dumps(document).encode()))


def _full(nodes: np.ndarray) -> np.ndarray:
    """Return the squares that have costs at all their corners."""
    has = nodes < UNLIMITED
    return np.asarray(has[:-1, :-1] & has[1:, :-1] & has[:-1, 1:] & has[1:, 1:])


def _touched(squares: np.ndarray) -> np.ndarray:
    """Return the nodes that are corners of squares."""
    around = np.pad(squares, 1)
    return np.asarray(around[:-1, :-1] | around[1:, :-1] | around[:-1, 1:] | around[1:, 1:])


def _rows(values: np.ndarray) -> list[list[float | None]]:
    """Return the numbers of an array, with None for what is none."""
    return [[None if number != number else number for number in row] for row in values.tolist()]
