"""`dubins_rrt render`, by the files it writes."""

import json

import numpy as np
import pytest

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import load_map


def ring(*corners):
    return [list(corner) for corner in (*corners, corners[0])]


def feature(role, *rings):
    return {"type": "Feature", "properties": {"role": role}, "geometry": {"type": "Polygon", "coordinates": rings}}


@pytest.fixture
def yard(tmp_path):
    """4 m x 2 m, and in it a box of 1 m."""
    features = [feature("bounds", ring((0, 0), (4, 0), (4, 2), (0, 2))),
                feature("obstacle", ring((1, 0), (2, 0), (2, 1), (1, 1)))]
    file = tmp_path / "yard.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return file


def test_the_grid_has_the_polygons_shape_and_a_wall_around(yard, tmp_path, capsys):
    assert main(["render", str(yard), "--resolution", "0.1", "--out", str(tmp_path / "maps")]) == 0
    grid = load_map(tmp_path / "maps" / "yard.yaml")
    assert grid.data.shape == (22, 42) and grid.resolution == 0.1
    assert grid.origin == pytest.approx((-0.1, -0.1, 0.0))
    expected = np.full((22, 42), 100)
    expected[1:-1, 1:-1] = 0
    expected[1:11, 11:21] = 100
    assert np.array_equal(grid.data, expected)
    said = capsys.readouterr().out
    assert str(tmp_path / "maps" / "yard.yaml") in said and "42 x 22" in said


def test_the_pair_is_written_beside_the_polygons_by_default(yard, capsys):
    assert main(["render", str(yard)]) == 0
    assert load_map(yard.with_suffix(".yaml")).resolution == 0.05


@pytest.mark.parametrize("resolution", ["0", "-1e-1", "nan", "1e-5"])
def test_a_resolution_of_no_use_is_refused_in_one_line(yard, resolution, capsys):
    assert main(["render", str(yard), "--resolution", resolution]) == 2
    error = capsys.readouterr().err
    assert "--resolution" in error and error.count("\n") == 1


def test_a_grid_is_refused(yard, capsys):
    main(["render", str(yard)])
    assert main(["render", str(yard.with_suffix(".yaml"))]) == 2
    assert "is a grid already" in capsys.readouterr().err
