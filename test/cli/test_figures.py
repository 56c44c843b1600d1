"""`dubins_rrt figures`: it draws what the documentation shows, always the same, and as the planner advances along curves."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from support.cases import needs_compiled, random_map

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.evaluation.figures import command as figures
from dubins_rrt_ros.evaluation.figures import geometry as figures_geometry
from dubins_rrt_ros.planning import ClearanceField, Vehicle
from dubins_rrt_ros.planning.collision.raster import CLEARANCE_MARGIN
from dubins_rrt_ros.planning.curves.dubins import shortest

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ROOT / "docs" / "figures"
#: Each page with a picture of this folder, and the picture.
SHOWN = sorted({(page.name, (page.parent / link).resolve()) for page in (ROOT / "README.md", *FIGURES.parent.glob("**/*.md"))
                for link in re.findall(r"!\[[^]]*\]\(([^)]*figures/[^)]+)\)", page.read_text("utf-8"))})


@pytest.mark.parametrize("page, file", SHOWN, ids=[f"{page}: {file.name}" for page, file in SHOWN])
def test_a_figure_that_a_page_shows_is_there_and_the_command_draws_it(page, file):
    assert file.parent == FIGURES and file.suffix == ".svg" and file.stem in figures.all_figures()
    assert file.read_text("utf-8").startswith("<?xml")


def test_no_figure_is_drawn_in_vain():
    assert {file.stem for _, file in SHOWN} == set(figures.all_figures())


def texts_of(file):
    """Titles, labels and figures in a picture: matplotlib writes each as a comment beside its outlines."""
    return re.findall(r"<!-- (.*) -->", file.read_text("utf-8"))


@pytest.mark.slow
@needs_compiled
def test_the_command_draws_all_figures_in_all_formats(tmp_path, capsys):
    folder, report = tmp_path / "new" / "figures", tmp_path / "report.json"
    assert main(["figures", "--out", str(folder), "--json", str(report)]) == 0
    names = figures.all_figures()
    assert capsys.readouterr() == (f"{folder}: {len(names)} figures, each as .svg and .png\n", "")
    files = json.loads(report.read_text())["files"]
    assert sorted(files) == sorted(str(folder / f"{name}{ending}") for name in names for ending in (".svg", ".png"))
    assert sorted(map(str, folder.iterdir())) == sorted(files)
    for name in names:
        assert imread(folder / f"{name}.png").shape[1] > 900
        assert (folder / f"{name}.svg").stat().st_size < 200_000
        assert texts_of(folder / f"{name}.svg") == texts_of(FIGURES / f"{name}.svg"), "the pages show what the planner did once"


@pytest.mark.slow
@pytest.mark.parametrize("name", figures_geometry.FIGURES)
def test_a_figure_has_the_same_bytes_each_time(name, tmp_path):
    first, again = (figures.save(figures_geometry.FIGURES[name](), tmp_path / f"{name}{i}") for i in range(2))
    assert [Path(file).read_bytes() for file in first] == [Path(file).read_bytes() for file in again]


@pytest.mark.slow
def test_the_advancement_that_is_drawn_finds_the_curves_free_that_the_planner_finds_free():
    rng, found = np.random.default_rng(1), []
    for _ in range(20):
        map = random_map(rng)
        field = ClearanceField(map)
        corners = map.corners()
        for points in corners[0] + rng.random((10, 2, 2)) @ (corners[[1, 3]] - corners[0]):
            start, goal = ((*point, float(rng.uniform(-4, 4))) for point in points.tolist())
            required, curve = float(rng.uniform(0, 0.5)), shortest(start, goal, 0.7)
            queries = figures_geometry.advance(field, curve, required)
            free = all(query.clearance >= required + CLEARANCE_MARGIN for query in queries)
            assert free == field.curve_is_free(curve, Vehicle(robot_radius=required))
            found.append(free)
    assert 20 < sum(found) < 180


@pytest.mark.parametrize("flags, words", [(["--out", __file__], "cannot be written"),
                                          (["--json", "no/such/folder/list.json"], "make it first")])
def test_wrong_usage_takes_one_line(flags, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["figures", *flags]) == 2
    out, error = capsys.readouterr()
    assert out == "" and words in error and error.startswith("dubins_rrt figures: error: ") and error.count("\n") == 1
    assert not list(tmp_path.iterdir())
