"""The checker of certificates: what is true is accepted, what was made false is refused."""

import gzip
import json
import os
import re

import numpy as np
import pytest
from support.cases import needs_compiled
from support.certificates import Certified, certified, hall, pose_in, recorded, refusal, saved
from support.spoils import SPOILS, Drive

from dubins_rrt_ros.checker.check import Refused, boxes_on, check, goal_boxes
from dubins_rrt_ros.checker.levels import FROM_START, Squares
from dubins_rrt_ros.checker.maps import UnreadableMap
from dubins_rrt_ros.cli.common.certificates import read_certificate
from dubins_rrt_ros.planning import Problem, Vehicle, load_map
from dubins_rrt_ros.planning.certificate.certificate import CertificateError, write_certificate

CAR = Vehicle(turning_radius=0.6, robot_radius=0.2)
START, GOAL = pose_in(hall(), 1.2, 1.0, 1.57), pose_in(hall(), 3.9, 1.0, -1.57)
#: A recorded certificate of two levels.
TURNED = recorded("turned")


def in_hall(folder, gap, vehicle=CAR, goal=GOAL, **request):
    """The certificate of a path in the hall."""
    grid = hall()
    return certified(Problem(grid, vehicle, START, goal, **request), saved(grid, folder), gap)


def verdict(folder, **fields):
    """The checker's sentence about the recorded certificate with other fields."""
    return refusal(Certified(TURNED.document | fields, TURNED.file), folder)


def spoilt(kind, folder):
    return SPOILS[kind](TURNED, np.random.default_rng(0), folder)


@needs_compiled
def test_a_certificate_is_accepted_and_its_claim_is_told(tmp_path):
    made = in_hall(tmp_path, 0.04)
    write_certificate(tmp_path / "path.cert", made.document)
    claim = check(read_certificate(tmp_path / "path.cert"), made.file)
    assert claim == {name: made.document[name] for name in ("request", "length", "bound")}
    assert claim["bound"] <= claim["length"] <= 1.05 * claim["bound"]
    assert len(made.document["levels"]) >= 1 and sum(map(len, made.document["boxes"])) > 10


def test_plain_json_will_do(tmp_path):
    (tmp_path / "path.cert").write_text(json.dumps(TURNED.document))
    assert check(read_certificate(tmp_path / "path.cert"), TURNED.file)["bound"] == TURNED.document["bound"]


@pytest.mark.parametrize(("kind", "said"), [
    ("2 mm too near", "too near to an obstacle"), ("wall added", "too near to an obstacle"),
    ("walls removed", "outside of all squares"), ("R + 0.1 %", "turns tighter"), ("bound above the path", "higher than"),
    ("box dropped", "do not cover"), ("costs too steep", "steeper than 1"), ("levels swapped", "ascend"),
    ("box closed", "may be free has no potential"), ("cell parted", "two cells meet")])
def test_the_refusal_says_what_does_not_hold(kind, said, tmp_path):
    assert said in refusal(spoilt(kind, tmp_path), tmp_path)


@pytest.mark.parametrize(("kind", "off"), [
    ("bound above the path", 0.001), ("potential above the path", 0.05), ("2 mm too near", 0.01), ("wall added", 0.01),
    ("box dropped", 0.1), ("box closed", 0.05), ("node raised", 0.4), ("square left out", 0.4)])
def test_the_refusal_says_where_in_the_frame_of_the_poses(kind, off, tmp_path):
    """And not in that of the map, whose origin is turned and off by metres."""
    said = refusal(spoilt(kind, tmp_path), tmp_path)
    place = json.loads(re.search(r" at (\[.*?\])", said)[1])
    path = load_map(TURNED.file).to_map_frame(Drive.of(TURNED).poses[:, :2])
    assert np.hypot(*(path - place).T).min() < off


def test_a_potential_that_is_too_high_is_told_with_place_and_figures(tmp_path):
    said = refusal(spoilt("bound above the path", tmp_path), tmp_path)
    bound, place = 1.0001 * TURNED.document["length"], [round(at, 3) for at in TURNED.document["request"]["goal"][:2]]
    figures = re.escape(f"the potential at {place} is {bound:.6g} m, ") + r"0\.\d+ m higher than those before it allow"
    assert re.fullmatch(figures, said)


def test_another_map_is_refused(tmp_path):
    other = Certified(TURNED.document, spoilt("walls removed", tmp_path).file)
    assert refusal(other, tmp_path) == "the map is not the one that the certificate is for"


@pytest.mark.parametrize(("field", "value", "said"), [
    ("length", 1.0, "the path is "), ("length", 1e3, "the path is "), ("length", None, "length is None, which is no number"),
    ("bound", {}, "bound is {}, which is no number"), ("bound", True, "bound is True"), ("certificate", 2, "of version 2"),
    ("certificate", True, "of version True"),
    ("path", [], "the path is 0 m long"), ("path", [["L", 0.6, 1e13]], "the path is 1e+13 m long"),
    ("limit", 1.0, "the corridor is too narrow"), ("boxes", [], "the boxes do not fit")])
def test_each_part_of_the_claim_is_looked_at(field, value, said, tmp_path):
    assert said in verdict(tmp_path, **{field: value})


def test_a_path_that_ends_elsewhere_is_refused(tmp_path):
    assert "beyond the goal's tolerance" in verdict(tmp_path, path=[], length=0.0)


def test_a_limit_far_below_the_bound_makes_no_bound_true(tmp_path):
    """The margin for rounding is a share of the limit: far below 0 it would excuse any bound."""
    hitch = recorded("hitch")
    for limit in (-1e15, 0.0):
        document = hitch.document | {"limit": limit, "bound": 2 * hitch.document["length"]}
        assert refusal(Certified(document, hitch.file), tmp_path) == "the limit is below the bound"


def test_a_path_of_more_poses_than_there_is_memory_for_is_refused(tmp_path):
    assert "too long to be looked at" in verdict(tmp_path, path=[["L", 0.6, 1e13]], length=1e13)


def test_the_request_is_of_numbers_and_an_outline_that_does_not_cross_itself(tmp_path):
    request = TURNED.document["request"]
    crossing = [[1, 1], [1, -1], [-1, 1], [-1, -1]]
    assert verdict(tmp_path, request=request | {"footprint": crossing}) == "the footprint crosses itself"
    assert "goal_tolerance_xy is False" in verdict(tmp_path, request=request | {"goal_tolerance_xy": False})
    assert "neither true nor false" in verdict(tmp_path, map=TURNED.document["map"] | {"allow_unknown": "no"})


def test_a_pipe_without_a_writer_is_not_waited_for_and_what_expands_without_an_end_is_refused(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "long.cert").write_bytes(gzip.compress(b" " * 10_000))
    monkeypatch.setattr("dubins_rrt_ros.cli.common.certificates.MOST_BYTES", 1000)
    for file, said in ((tmp_path / "pipe", "as certificates are"), ("/dev/zero", "1000 bytes or more"),
                       (tmp_path / "long.cert", "1000 bytes or more")):
        with pytest.raises(Refused, match=said):
            check(read_certificate(file), TURNED.file)


def test_squares_and_a_vehicle_without_a_size_are_refused(tmp_path):
    squares, request = TURNED.document["squares"], TURNED.document["request"]
    assert "no size" in verdict(tmp_path, squares=squares | {"side": 0})
    for name in ("robot_radius", "goal_tolerance_xy"):
        assert "below 0" in verdict(tmp_path, request=request | {name: -1.0})
        assert "no number" in verdict(tmp_path, request=request | {name: float("nan")})


@pytest.mark.parametrize("tolerance", [0.0, 0.3])
@pytest.mark.parametrize("turn", [0.0, 0.04, 0.7])
def test_boxes_of_the_goal_cover_where_it_is_reached_and_little_more(tolerance, turn):
    rng = np.random.default_rng(1)
    boxes = goal_boxes((1.0, 2.0, 0.5), tolerance, turn, 7.0, 0.0)
    angle, share = rng.uniform(-np.pi, np.pi, 500), np.sqrt(rng.random(500)) * tolerance
    poses = np.column_stack([1 + share * np.cos(angle), 2 + share * np.sin(angle), 0.5 + turn * rng.uniform(-1, 1, 500)])
    off = np.abs(poses[:, None] - boxes[:, (0, 1, 6)])
    assert (off <= boxes[:, (4, 5, 7)] + 1e-12).all(axis=2).any(axis=1).all()
    assert (np.hypot(*np.maximum(0, np.abs(boxes[:, :2] - (1, 2)) - boxes[:, 4:6]).T) <= tolerance).all()
    assert (boxes[:, 8] == 7).all() and boxes[:, 7].max() < 0.0501 and boxes[:, 4].max() <= tolerance / 8
    assert sum(boxes[:, 4] * boxes[:, 5] * boxes[:, 7]) <= 1.5 * tolerance**2 * turn


def test_boxes_on_gates_are_shares_of_them_and_of_the_headings():
    gates = np.array([[3.0, 2.0, 0.6, 0.8, 0.5, 0.0, 1.2, 1.6, 0.0, 7.0, 5.0]] * 3)
    rows = np.array([(-1, 1, -1, 1, 3.0), (-0.5, 0, -1, 0, np.nan), (0, 1, 0.5, 1, 2.0)])
    for box, (s0, s1, h0, h1, u) in zip(boxes_on(gates, rows, 1e-3), rows, strict=True):
        place, heading = (s0 + s1) / 2 * 0.5, 1.2 + (h0 + h1) / 2 * 1.6
        assert box[:4] == pytest.approx((3 + 0.6 * place, 2 + 0.8 * place, 0.6, 0.8))
        assert box[4:8] == pytest.approx(((s1 - s0) / 2 * 0.5 + 1e-3, 1e-3, heading, (h1 - h0) / 2 * 1.6))
        assert box[8:] == pytest.approx((u, 7, 5), nan_ok=True)


def test_a_start_on_a_level_is_refused(tmp_path):
    """It would be in two cells."""
    drive = Drive.of(TURNED)
    levels = [drive.squares.at(FROM_START, *drive.poses[0, :2])[1] + 1e-9, *TURNED.document["levels"]]
    parts = Squares(TURNED.document | {"levels": levels}).parts
    cells = np.nonzero(parts)[0].tolist()  # one for each slab
    assert verdict(tmp_path, levels=levels, cells=cells) == "an end is not inside a slab"


def test_a_start_outside_of_all_squares_is_refused(tmp_path):
    """Rows are not counted from the other end: squares somewhere else prove nothing of this start."""
    squares = TURNED.document["squares"]
    for axis in (0, 1):
        corner = list(squares["corner"])
        corner[axis] += squares["side"] * (len(squares["free"]), len(squares["free"][0]))[1 - axis]
        assert "outside of all squares" in verdict(tmp_path, squares=squares | {"corner": corner})


def test_boxes_that_reach_beyond_their_gates_are_refused(tmp_path):
    """The middle of one that reaches too far is no number, of which nothing would be shown."""
    boxes = [[[-1e308, 1e308, -1, 1, 9.0]] if some else [] for some in TURNED.document["boxes"]]
    assert "do not fit the gates" in verdict(tmp_path, boxes=boxes)


@pytest.mark.parametrize("number", ["1e999", "-Infinity", "NaN"])
def test_what_is_no_number_is_refused(number, tmp_path):
    (tmp_path / "path.cert").write_text(json.dumps(TURNED.document | {"limit": 777.25}).replace("777.25", number))
    with pytest.raises(Refused, match="is no number"):
        check(read_certificate(tmp_path / "path.cert"), TURNED.file)


@pytest.mark.parametrize("cells", [[], [0], None])
def test_cells_have_to_fit(cells, tmp_path):
    negative = [-1 for _ in TURNED.document["cells"]]
    assert "cells do not fit" in verdict(tmp_path, cells=negative if cells is None else cells)


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(b"", id="empty"),
        pytest.param(b"{}", id="no keys"),
        pytest.param(b"[1]", id="a list"),
        pytest.param(b"{\"map\": 1}", id="a map that is a number"),
        pytest.param(b"\x1f\x8bnothing", id="no gzip"),
        pytest.param(gzip.compress(b"{"), id="cut JSON in gzip"),
        pytest.param(b"[" * 100_000, id="nested too deep"),
        pytest.param(gzip.compress(b"{}" * 50)[:10] + b"\xff" * 50, id="no deflate"),
    ],
)
def test_what_is_no_certificate_is_refused(content, tmp_path):
    (tmp_path / "path.cert").write_bytes(content)
    with pytest.raises(Refused, match=re.escape("the file is not as certificates are")):
        check(read_certificate(tmp_path / "path.cert"), TURNED.file)


def test_a_map_that_cannot_be_read_is_no_verdict(tmp_path):
    write_certificate(tmp_path / "path.cert", TURNED.document)
    (tmp_path / "map.yaml").write_text("image: none.pgm")
    with pytest.raises(UnreadableMap, match="KeyError"):
        check(read_certificate(tmp_path / "path.cert"), tmp_path / "map.yaml")


@needs_compiled
def test_a_footprint_and_a_goal_with_tolerances_are_certified(tmp_path):
    vehicle = Vehicle.from_footprint([[0.35, 0.2], [-0.25, 0.2], [-0.25, -0.2], [0.35, -0.2]], turning_radius=0.7)
    found = in_hall(tmp_path, 0.3, vehicle, pose_in(hall(), 1.5, 3.2, 0.0), goal_tolerance_xy=0.2, any_goal_heading=True)
    assert refusal(found, tmp_path) == ""
    found.document["request"]["footprint"][0][0] = 2.5
    assert "obstacle" in refusal(found, tmp_path)


@needs_compiled
def test_a_short_time_gives_a_bound_all_the_same(tmp_path):
    grid = hall()
    found = certified(Problem(grid, CAR, START, GOAL), saved(grid, tmp_path), gap=0.0, seconds=0.0)
    assert refusal(found, tmp_path) == "" and 0.5 * found.document["length"] < found.document["bound"]


def test_without_a_disc_inside_the_dubins_curve_alone_is_the_bound(tmp_path):
    hitch = recorded("hitch")
    assert hitch.document["levels"] == []
    assert "higher than" in refusal(SPOILS["bound + 0.01 %"](hitch, None, tmp_path), tmp_path)


def test_a_start_nearer_than_allowed_has_no_certificate(tmp_path):
    with pytest.raises(CertificateError, match="start_slack"):
        in_hall(tmp_path, 0.1, start_slack=0.1)
