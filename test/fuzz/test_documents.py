"""Whatever is in a plan's or a problems file, there is a request or a sentence. `test_maps.py` says how to run more of them."""

import json

import pytest
import shapely
from hypothesis import given, settings
from support.bounded import read_or_refused
from support.mutations import json_of, spoiled_documents

from dubins_rrt_ros.cli.bench.problems import Case, read_cases
from dubins_rrt_ros.cli.common.parser import UsageError
from dubins_rrt_ros.cli.common.request import read_replay
from dubins_rrt_ros.planning import InvalidPose, MapError, OptionError, PolygonMap, Problem, Settings, Vehicle, options, values
from dubins_rrt_ros.planning.curves.path import Path
from dubins_rrt_ros.planning.plan_file import PlanFileError, read_path, read_request

HALL = PolygonMap(shapely.box(0, 0, 12, 10).difference(shapely.box(5, 0, 6, 6)))
START, GOAL = [2.0, 2.0, 1.5], [9.0, 2.0, -1.5]
CASE = {"name": "hall", "map": "hall.wkt", "start": START, "goal": GOAL, "turning_radius": 1.0, "robot_radius": 0.2}
PLAN = {
    "error_code": 0, "error_name": "NONE", "message": "", "planner": "rrt", "seed": 4, "samples": 150, "tree_nodes": 9,
    "curves": [{"start": START, "radius": 1.0, "word": "LSL", "lengths": [0.5, 2.0, 0.0]},
               {"start": [3.0, 4.0, 0.0], "radius": 1.0, "word": "RLR", "lengths": [0.1, 5.0, 0.1]}],
    "poses": [START, [3.0, 4.0, 0.0], GOAL], "map": "hall.wkt", "map_id": HALL.id, "start": START, "goal": GOAL,
    "vehicle": values(Vehicle()), "settings": {item.name: item.default for cls in (Problem, Settings) for item in options(cls)},
}
fuzz = settings.get_profile("fuzz")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With the map that the documents name."""
    folder = tmp_path_factory.mktemp("documents")
    (folder / "hall.wkt").write_text(HALL.free.wkt)
    return folder


def test_the_documents_are_good_before_they_are_spoiled(folder):
    (folder / "good.json").write_text(json.dumps(PLAN))
    assert read_replay(str(folder / "good.json"), max_map_cells=10_000).path.curves[1].word == "RLR"
    (folder / "good.json").write_text(json.dumps([CASE]))
    assert read_cases(str(folder / "good.json"))[0].vehicle == Vehicle()


@pytest.mark.slow
@fuzz
@given(content=json_of([[CASE, {**CASE, "name": "again", "check_step": 0.1}], [CASE]]))
def test_problems(folder, content):
    (folder / "problems.json").write_bytes(content)
    cases = read_or_refused(lambda: read_cases(str(folder / "problems.json")), UsageError)
    assert cases is None or all(isinstance(case, Case) for case in cases)


@fuzz
@given(content=json_of([PLAN]))
def test_replay(folder, content):
    (folder / "plan.json").write_bytes(content)
    request = read_or_refused(lambda: read_replay(str(folder / "plan.json"), max_map_cells=10_000),
                              UsageError, PlanFileError, OptionError, InvalidPose, MapError)
    assert request is None or request.path is None or isinstance(request.path, Path)


@fuzz
@given(spoiled_documents([PLAN]).filter(lambda document: isinstance(document, dict)))
def test_plan(document):
    """The document alone, whatever map it was planned on."""
    found = read_or_refused(lambda: (read_request(document, HALL), read_path(document)), PlanFileError, OptionError, InvalidPose)
    if found and found[1]:
        assert all(curve.radius > 0 and 0 <= min(curve.lengths) <= curve.length for curve in found[1].curves)
