"""Whatever is in a file of poses or of a plan, `audit` has a verdict or a sentence. `test_maps.py` says how to run more."""

import contextlib
import io
import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.bounded import read_or_refused
from support.images import pgm, row_of, saved
from support.mutations import NUMBERS, json_of, spoiled

from dubins_rrt_ros.cli.common.documents import read_poses_or_json
from dubins_rrt_ros.cli.common.parser import UsageError
from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import GridMap, MapError, Problem, Settings, Vehicle, load_map, plan
from dubins_rrt_ros.planning.plan_file import to_document

CSV = b"x,y,theta\n2.0,2.0,1.5\n2.0,2.5,1.5\n2.1,3.0,1.5\n"
ECHOED = b"""header:
  stamp: {sec: 1, nanosec: 5}
  frame_id: map
poses:
- header: {stamp: {sec: 1, nanosec: 5}, frame_id: map}
  pose:
    position: {x: 2.0, y: 2.0, z: 0.0}
    orientation: {x: 0.0, y: 0.0, z: 0.7, w: 0.7}
- pose: {position: {x: 2.0, y: 2.5, z: 0.0}, orientation: {x: 0.0, y: 0.0, z: 0.70711, w: 0.70711}}
---
"""
PICTURES = [("m.pgm", pgm([[0, 100, 205, 254]])), ("m.png", saved(row_of("RGB", (1, 2, 3)))),
            ("m.bmp", saved(row_of("L", 0, 254), "BMP"))]
#: Maximum length of an echoed message [bytes]: PyYAML takes a second for some ten times as much.
LONGEST_ECHO = 4096
fuzz = settings.get_profile("fuzz")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With a map."""
    folder = tmp_path_factory.mktemp("paths")
    (folder / "hall.wkt").write_text("POLYGON ((0 0, 5 0, 5 6, 6 6, 6 0, 12 0, 12 10, 0 10, 0 0))")
    return folder


@pytest.fixture(scope="module")
def document(folder):
    """A plan's, of several curves."""
    problem = Problem(load_map(folder / "hall.wkt"), Vehicle(1.0, 0.2), (2.0, 2.0, 1.5), (9.0, 2.0, -1.5))
    return json.loads(json.dumps(to_document(plan(problem, Settings(samples=20, seed=1, path_spacing=1.0)), "hall.wkt")))


def judged(folder, name, content, *flags):
    """The exit status of the audit, which says a verdict or, in a line, what is wrong with the file."""
    (folder / name).write_bytes(content)
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = main(["audit", str(folder / name), str(folder / "hall.wkt"), *flags])
    lines = error.getvalue().splitlines()
    assert (status in (0, 1) and lines == [] and out.getvalue()) or (status in (1, 2) and len(lines) == 1), (status, lines)
    assert all(line.isprintable() for line in [*lines, *out.getvalue().splitlines()])
    return status


def test_the_files_are_good_before_they_are_spoiled(folder, document):
    assert judged(folder, "p.csv", CSV, "--tolerance-xy", "0.2") == 0
    assert judged(folder, "p.yaml", ECHOED, "--tolerance-xy", "0.2") == 0
    assert judged(folder, "p.json", json.dumps(document).encode()) == 0


@fuzz
@given(content=spoiled([CSV]) | st.binary(max_size=60).map(lambda rest: b"x,y,theta\n" + rest))
def test_csv(folder, content):
    judged(folder, "p.csv", content)


@fuzz
@given(content=spoiled([ECHOED]).map(lambda content: content[:LONGEST_ECHO]))
def test_echoed_path(folder, content):
    (folder / "p.yaml").write_bytes(content)
    found = read_or_refused(lambda: read_poses_or_json(str(folder / "p.yaml")), UsageError)
    if found is not None:
        judged(folder, "p.yaml", content)


@pytest.mark.slow
@fuzz
@given(data=st.data())
def test_plan_document(folder, document, data):
    judged(folder, "p.json", data.draw(json_of([document])))


@fuzz
@given(picture=st.sampled_from(PICTURES).flatmap(lambda item: st.tuples(st.just(item[0]), spoiled([item[1]]) | st.just(item[1]))),
       resolution=st.floats() | st.sampled_from([None, 0, -1, 0.05, 10**400, math.nan, "0.05", "m", True, [0.1], *NUMBERS]))
def test_picture_with_a_resolution(folder, picture, resolution):
    name, content = picture
    (folder / name).write_bytes(content)
    found = read_or_refused(lambda: load_map(folder / name, resolution=resolution, max_map_cells=10_000), MapError)
    assert found is None or isinstance(found, GridMap)
