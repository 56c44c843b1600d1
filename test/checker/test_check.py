"""The checker of certificates: what is true is accepted, what was made false is refused."""

import gzip
import json
import re

import numpy as np
import pytest
from support.cases import needs_compiled
from support.certificates import SPOILS, certified, hall, hall_pose, opened, spoiled, too_near, walled

from dubins_rrt_ros.checker.check import Refused, check
from dubins_rrt_ros.checker.maps import UnreadableMap
from dubins_rrt_ros.planning import Vehicle
from dubins_rrt_ros.planning.certificate.certificate import CertificateError, write_certificate

pytestmark = needs_compiled
START, GOAL = hall_pose(1.2, 1.0, 1.57), hall_pose(3.9, 1.0, -1.57)


@pytest.fixture(scope="module")
def of_hall(tmp_path_factory):
    vehicle = Vehicle(turning_radius=0.6, robot_radius=0.2)
    return certified(hall(), vehicle, START, GOAL, tmp_path_factory.mktemp("hall"), gap=0.04)


def verdict(document, map_file, folder):
    """The checker's sentence about a document, "" where it holds."""
    write_certificate(folder / "path.cert", document)
    try:
        check(folder / "path.cert", map_file)
    except Refused as refusal:
        return str(refusal)
    return ""


def test_a_certificate_is_accepted_and_its_claim_is_told(of_hall, tmp_path):
    write_certificate(tmp_path / "path.cert", of_hall.document)
    claim = check(tmp_path / "path.cert", of_hall.file)
    assert claim["length"] == of_hall.path.length and claim["bound"] <= claim["length"] <= 1.05 * claim["bound"]
    assert len(of_hall.document["levels"]) >= 1 and len(of_hall.document["boxes"]) > 10


def test_plain_json_will_do(of_hall, tmp_path):
    (tmp_path / "path.cert").write_text(json.dumps(of_hall.document))
    assert check(tmp_path / "path.cert", of_hall.file)["bound"] == of_hall.document["bound"]


@pytest.mark.parametrize("name", SPOILS)
def test_a_false_claim_is_refused(name, of_hall, tmp_path):
    said = [verdict(spoiled(of_hall, name, np.random.default_rng(seed)), of_hall.file, tmp_path) for seed in range(1)]
    assert name in ("bound + 0.01 %", "a potential raised") or all(said), name


def test_a_vehicle_that_comes_too_near_is_refused(of_hall, tmp_path):
    assert "too near to an obstacle" in verdict(too_near(of_hall), of_hall.file, tmp_path)


def test_a_wall_on_the_path_is_seen(of_hall, tmp_path):
    assert "too near to an obstacle" in verdict(*walled(of_hall, tmp_path), tmp_path)


def test_a_proof_does_not_hold_without_the_wall(of_hall, tmp_path):
    assert "outside of all squares" in verdict(*opened(of_hall, tmp_path), tmp_path)


def test_another_map_is_refused(of_hall, tmp_path):
    _, other = opened(of_hall, tmp_path)
    assert verdict(of_hall.document, other, tmp_path) == "the map is not the one that the certificate is for"


@pytest.mark.parametrize(("field", "value", "said"), [
    ("length", 1.0, "the path is "), ("path", [], "beyond the goal's tolerance"),
    ("limit", 1.0, "the corridor is too narrow"), ("cells", [], "the cells do not fit")])
def test_each_part_of_the_claim_is_looked_at(field, value, said, of_hall, tmp_path):
    assert said in verdict(of_hall.document | {field: value}, of_hall.file, tmp_path)


def test_squares_without_parts_and_a_vehicle_without_a_size_are_refused(of_hall, tmp_path):
    squares, request = of_hall.document["squares"], of_hall.document["request"]
    assert "no size" in verdict(of_hall.document | {"squares": squares | {"parts": 0}}, of_hall.file, tmp_path)
    for name in ("robot_radius", "goal_tolerance_xy"):
        assert "below 0" in verdict(of_hall.document | {"request": request | {name: -1.0}}, of_hall.file, tmp_path)
        assert "no number" in verdict(of_hall.document | {"request": request | {name: float("nan")}}, of_hall.file, tmp_path)


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(b"", id="empty"),
        pytest.param(b"{}", id="no keys"),
        pytest.param(b"[1]", id="a list"),
        pytest.param(b"{\"map\": 1}", id="a map that is a number"),
        pytest.param(b"\x1f\x8bnothing", id="no gzip"),
        pytest.param(gzip.compress(b"{"), id="cut JSON in gzip"),
    ],
)
def test_what_is_no_certificate_is_refused(content, of_hall, tmp_path):
    (tmp_path / "path.cert").write_bytes(content)
    with pytest.raises(Refused, match=re.escape("the file is not as certificates are")):
        check(tmp_path / "path.cert", of_hall.file)


def test_a_map_that_cannot_be_read_is_no_verdict(of_hall, tmp_path):
    write_certificate(tmp_path / "path.cert", of_hall.document)
    (tmp_path / "map.yaml").write_text("image: none.pgm")
    with pytest.raises(UnreadableMap, match="KeyError"):
        check(tmp_path / "path.cert", tmp_path / "map.yaml")


def test_a_footprint_and_a_goal_with_tolerances_are_certified(tmp_path):
    vehicle = Vehicle.from_footprint([[0.35, 0.2], [-0.25, 0.2], [-0.25, -0.2], [0.35, -0.2]], turning_radius=0.7)
    found = certified(hall(), vehicle, START, hall_pose(1.5, 3.2, 0.0), tmp_path, gap=0.3, goal_tolerance_xy=0.2,
                      any_goal_heading=True)
    assert verdict(found.document, found.file, tmp_path) == ""
    found.document["request"]["footprint"][0][0] = 2.5
    assert "obstacle" in verdict(found.document, found.file, tmp_path)


def test_without_a_disc_inside_the_dubins_curve_alone_is_the_bound(tmp_path):
    hitch = Vehicle.from_footprint([[0.8, 0.2], [0.1, 0.2], [0.1, -0.2], [0.8, -0.2]], turning_radius=0.7)
    found = certified(hall(), hitch, START, hall_pose(1.5, 3.2, 0.0), tmp_path, gap=0.3)
    assert found.document["levels"] == [] and verdict(found.document, found.file, tmp_path) == ""
    assert "higher than" in verdict(spoiled(found, "bound + 0.01 %", None), found.file, tmp_path)


def test_a_start_nearer_than_allowed_has_no_certificate(tmp_path):
    with pytest.raises(CertificateError, match="start_slack"):
        certified(hall(), Vehicle(turning_radius=0.6, robot_radius=0.2), START, GOAL, tmp_path, start_slack=0.1)
