"""The checker against claims that are made by hand, about a path in an empty room of a square metre."""

import itertools
import math

import numpy as np
import pytest
from support.certificates import Certified, recorded, refusal, saved
from support.spoils import Drive

from dubins_rrt_ros.checker import check as checker
from dubins_rrt_ros.checker.check import inner_radius, ways
from dubins_rrt_ros.checker.maps import read_map
from dubins_rrt_ros.planning import GridMap

#: Side of the room [m], and of its cells.
ROOM, CELL = 1.0, 0.05


def room(folder, *blocked):
    """The map of the room, with the cells blocked that hold some places."""
    data = np.zeros((20, 20), np.int8)
    for x, y in blocked:
        data[int(y / CELL), int(x / CELL)] = 100
    return saved(GridMap(data, CELL, (0.0, 0.0, 0.0)), folder / "room")


def claim(file, start, path, **request):
    """A true claim about a path, which says of shorter ones nothing."""
    world = read_map(file, False)
    request = {"robot_radius": 0.05, "footprint": [], "turning_radius": 0.2, "goal_tolerance_xy": 0.0,
               "goal_tolerance_yaw": 0.0, "start": list(start)} | request
    request["goal"] = checker._poses(tuple(start), path, 0.0)[-1].tolist()
    length = sum(metres for _, _, metres in path)
    return {"certificate": 1, "map": world.description | {"allow_unknown": False}, "request": request, "path": path,
            "length": length, "bound": 0.0, "limit": length, "levels": [], "cells": [], "boxes": [], "from_start": [],
            "to_goal": [], "squares": {"corner": [0, 0], "side": 1, "free": []}}


def verdict(document, file, folder):
    return refusal(Certified(document, file), folder)


BEND = [["L", 0.2, 0.3], ["S", 0.2, 0.1], ["R", 0.25, 0.2]]


@pytest.mark.parametrize(("change", "said"), [
    ((0, 0, 0), ""), ((1e-4, 0, 0), "ends 0.0001 m"), ((0, -1e-4, 0), "ends 0.0001 m"), ((0, 0, 1e-4), "0.0001 rad beyond"),
    ((0, 0, 2 * math.pi), "")])
def test_a_path_ends_at_the_goal_in_place_and_heading(change, said, tmp_path):
    file = room(tmp_path)
    document = claim(file, (0.3, 0.3, 0.2), BEND)
    document["request"]["goal"] = np.add(document["request"]["goal"], change).tolist()
    assert said in verdict(document, file, tmp_path) and bool(said) == bool(verdict(document, file, tmp_path))


def test_a_bound_keeps_a_margin_for_rounding(tmp_path):
    file = room(tmp_path)
    document = claim(file, (0.3, 0.3, 0.0), [["S", 0.2, 0.5]])
    for above, said in ((-1e-7, ""), (3e-12, "higher than those before it allow")):
        bound = document["length"] + above
        found = verdict(document | {"bound": bound, "limit": max(bound, document["length"])}, file, tmp_path)
        assert said in found and bool(said) == bool(found)


@pytest.mark.parametrize(("start", "turn", "metres"), [
    ((0.4923326448972576, 0.5327702593820443, -0.5448051817850326), "R", 0.5171546345221005),
    ((0.4522617728887003, 0.4618105227150859, -0.838416691898141), "R", 0.12954882508620977),
    ((0.4650957540061147, 0.4700553667472125, 0.8877617585703992), "R", 0.27571780593235745),
    *(((0.5, 0.5, heading), "LR"[heading % 2], 0.1 + 0.05 * heading) for heading in range(6))])
def test_the_bound_of_a_single_arc_is_not_a_whole_turn_too_high(start, turn, metres, tmp_path):
    """Of the straight line between two turns, which is none here, rounding alone would tell the direction."""
    file = room(tmp_path)
    document = claim(file, start, [[turn, 0.2, metres]])
    assert verdict(document | {"bound": metres - 1e-7}, file, tmp_path) == ""
    above = verdict(document | {"bound": metres + 0.1, "limit": metres + 0.1}, file, tmp_path)
    assert "higher than those before it allow" in above


def test_poses_have_three_numbers(tmp_path):
    file = room(tmp_path)
    document = claim(file, (0.3, 0.3, 0.2), BEND)
    for pose in ((0.3, 0.3), (0.3, 0.3, 0.2, 0.0)):
        said = verdict(document | {"request": document["request"] | {"start": pose}}, file, tmp_path)
        assert "not as certificates are" in said


def test_tolerances_of_place_and_heading_are_used_up_one_by_one(tmp_path):
    file = room(tmp_path)
    for xy, yaw, change, holds in ((0.1, 0.0, (0.06, 0.07, 0), True), (0.1, 0.0, (0.08, 0.08, 0), False),
                                   (0.0, 0.2, (0, 0, -0.19), True), (0.0, 0.2, (0, 0, 0.21), False)):
        document = claim(file, (0.3, 0.3, 0.2), BEND, goal_tolerance_xy=xy, goal_tolerance_yaw=yaw)
        document["request"]["goal"] = np.add(document["request"]["goal"], change).tolist()
        assert (verdict(document, file, tmp_path) == "") == holds


#: A square of 0.4 m around the reference point, and where it starts.
SQUARE, START = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]], (0.325, 0.525, 0.0)


@pytest.mark.parametrize(("blocked", "path", "said"), [
    (None, [["S", 0.2, 0.2]], ""),
    pytest.param((0.36, 0.53), [["S", 0.2, 0.1]], "where it starts", id="inside the outline all the way"),
    pytest.param((0.66, 0.53), [["S", 0.2, 0.2]], "too near", id="met by the side in front"),
    pytest.param((0.52, 0.78), [["L", 0.3, 0.2]], "too near", id="met by the side on the left"),
    pytest.param((0.32, 0.28), [["L", 0.3, 0.2]], "too near", id="met by a corner that swings out"),
    pytest.param((0.77, 0.53), [["S", 0.2, 0.2]], "", id="not met")])
def test_all_sides_of_an_outline_are_driven(blocked, path, said, tmp_path):
    file = room(tmp_path, *[blocked] if blocked else [])
    found = verdict(claim(file, START, path, footprint=SQUARE, robot_radius=0.0), file, tmp_path)
    assert said in found and bool(said) == bool(found)


@pytest.mark.parametrize(("word", "radius", "reach"), [("L", 0.5, 0.0), ("R", 0.2, 0.7), ("L", 3.0, 2.0), ("S", 0.2, 1.0)])
def test_what_is_within_reach_drives_near_straight_lines(word, radius, reach, monkeypatch):
    """And the path is not cut into more pieces than that takes."""
    monkeypatch.setattr(checker, "SAGITTA", 1e-3)
    for turn in (0.3, 1.0, 2.9):
        poses = checker._poses((1.0, 2.0, 0.3), [[word, radius, turn * radius]], reach)
        step = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        assert step.sum() <= turn * radius + 1e-12 and step == pytest.approx(step[0])
        turns = np.abs(np.diff(poses[:, 2]))
        assert turns.sum() == pytest.approx(0 if word == "S" else turn)
        sagitta = (radius + reach) * (1 - np.cos(turns / 2))
        assert sagitta.max() <= 1e-3
        assert len(step) == 1 or sagitta.max() * (len(step) / (len(step) - 1))**2 > 0.99e-3


def in_two_squares(file, squares, limit=5.0):
    """The claim of a drive between the middles of two of the room's four quarters, which alone are in the corridor.

    The costs to the goal are below the limit at one node of each, which no other square has; no path crosses the level.
    """
    (row, column), (other_row, other_column) = squares
    a, b = ((0.25 + 0.5 * i, 0.25 + 0.5 * j) for j, i in squares)
    document = claim(file, (*a, math.atan2(b[1] - a[1], b[0] - a[0])), [["S", 0.2, math.dist(a, b)]])
    to_goal = np.full((3, 3), limit + 0.1)
    to_goal[2 * row, 2 * column] = to_goal[2 * other_row, 2 * other_column] = limit - 0.1
    return document | {"squares": {"corner": [0, 0], "side": 0.5, "free": ["11", "11"]}, "levels": [1.0], "limit": limit + 1e-6,
                       "from_start": np.zeros((3, 3)).tolist(), "to_goal": to_goal.tolist(), "cells": [0, 0]}


@pytest.mark.parametrize("squares", list(itertools.permutations(itertools.product((0, 1), repeat=2), 2)))
def test_squares_that_touch_are_one_cell(squares, tmp_path):
    """Also where they touch at a corner."""
    file = room(tmp_path)
    document = in_two_squares(file, squares)
    # The corridor begins where the goal's costs are below the limit; here they are nearly that: the bound has to be below 0.
    document["bound"] = -0.2
    assert verdict(document, file, tmp_path) == ""
    assert verdict(document | {"cells": [0, 1]}, file, tmp_path) == "two cells meet within a slab"


@pytest.mark.parametrize("name", ["turned", "tolerances"])
@pytest.mark.parametrize("field", ["to_goal", "from_start"])
def test_costs_above_0_at_the_ends_take_a_wider_corridor(name, field, tmp_path):
    certified = recorded(name)
    higher, document = 5.0, certified.document
    changed = {field: [[None if cost is None else cost + higher for cost in row] for row in document[field]]}
    if field == "from_start":
        changed["levels"] = [level + higher for level in document["levels"]]
    assert verdict(document | changed | {"limit": document["limit"] + higher}, certified.file, tmp_path) == ""
    for limit in (document["limit"], document["limit"] + 0.8 * higher, document["limit"] - higher):
        assert "too narrow" in verdict(document | changed | {"limit": limit}, certified.file, tmp_path)


@pytest.mark.parametrize("name", ["polygons", pytest.param("footprint", marks=pytest.mark.slow)])
def test_no_square_with_a_free_place_may_be_left_out(name, tmp_path):
    """Of those in whose middle there is no room: looked for on a fine raster."""
    certified = recorded(name)
    document, drive = certified.document, Drive.of(certified)
    squares = drive.squares
    raster, inner = (np.arange(24) + 0.5) / 24, inner_radius(document["request"])
    places = np.stack(np.meshgrid(raster, raster, indexing="ij"), axis=-1).reshape(-1, 2)
    corners = np.argwhere(squares.domain)
    room_at = drive.world.clearances((squares.corner + squares.side * (corners[:, None, ::-1] + places)).reshape(-1, 2), 1.0)
    is_free = room_at.reshape(len(corners), -1) >= inner + 1e-3
    middle = drive.world.clearances(squares.corner + squares.side * (corners[:, ::-1] + 0.5), 1.0) >= inner
    chosen = np.flatnonzero(~middle & is_free.any(axis=1))
    assert len(chosen) >= 20
    freest_last = chosen[is_free[chosen].sum(axis=1).argsort(kind="stable")]
    for row, column in corners[freest_last[:20]]:  # they are free in a corner
        free = list(document["squares"]["free"])
        free[row] = free[row][:column] + "0" + free[row][column + 1:]
        changed = document | {"squares": document["squares"] | {"free": free}}
        assert "the vehicle may be outside of all squares at [" in verdict(changed, certified.file, tmp_path)


@pytest.mark.parametrize(("halvings", "said"), [(3, "the vehicle may be outside of all squares at ["), (4, "")])
def test_squares_that_are_not_cut_often_enough_to_tell_are_refused(halvings, said, tmp_path, monkeypatch):
    """In the middle of each of their parts there is no room."""
    monkeypatch.setattr(checker, "SQUARE_HALVINGS", halvings)
    found = refusal(recorded("polygons"), tmp_path)
    assert said in found and bool(said) == bool(found)


def test_no_box_with_a_free_place_goes_without_a_potential(tmp_path):
    """Also where there is no room in its middle."""
    judged = 0
    for certified in map(recorded, ("turned", "gallery", "polygons")):
        drive, inner = Drive.of(certified), inner_radius(certified.document["request"])
        for number, rows in enumerate(certified.document["boxes"]):
            x, y, c, s, half = drive.gates[number, :5]
            room = drive.world.clearances(np.array([(x + share * half * c, y + share * half * s) for share in (0, -1, 1)]), 1.0)
            if rows and room[0] < inner < room.max() - 1e-6:
                boxes = list(certified.document["boxes"])
                boxes[number] = [[-1, 1, -1, 1, None]]
                said = verdict(certified.document | {"boxes": boxes}, certified.file, tmp_path)
                assert said.startswith("a box that may be free has no potential at [")
                judged += 1
    assert judged >= 4


def test_the_portals_of_all_ways_that_never_turn_back_are_used():
    rng = np.random.default_rng(1)
    for _ in range(60):
        pairs = [pair for pair in itertools.combinations(range(5), 2) if rng.random() < 0.5]
        portals = {(a, b) for pair in pairs for a, b in (pair, pair[::-1])} | {(2, 2)}
        goals = set(rng.choice((1, 2, 3, 4), rng.integers(1, 3), replace=False).tolist())
        used, due = set(), [[0]]
        while due:
            way = due.pop()
            if len(way) > 1 and way[-1] in goals:
                used.update(itertools.pairwise(way))
                if goals == {way[-1]}:
                    continue
            due += [[*way, after] for before, after in portals if before == way[-1] != after and after != 0
                    and after not in way[-2:] and len(way) < 8]
        crossings = np.array(sorted(portals))
        steps = ways(crossings, 0, goals)
        assert {tuple(portal) for portal in crossings[steps.any(axis=0)[:len(crossings)]].tolist()} == used
