"""Pictures from the library: plots on axes, notebooks, animations; and that none of it is imported before it is asked for."""

import io
import math
import re
import subprocess
import sys
from dataclasses import replace

import matplotlib.figure
import matplotlib.pyplot
import numpy as np
import pytest
import shapely
from PIL import Image
from support.cases import empty_map, needs_compiled

from dubins_rrt_ros.planning import GridMap, PictureError, Problem, Settings, Vehicle, load_map, pictures, plan, plan_through
from dubins_rrt_ros.planning.pictures import drawing
from dubins_rrt_ros.planning.pictures.animation import Recording, _SearchScreen, save_drive

#: What is drawn of a path does not depend on the kernels that found it.
pytestmark = needs_compiled

EVERY, SAMPLES = 7, 60
#: Settings for a picture that shows poses, whatever is found.
QUICK = Settings(planner="rrt", planning_time=0.2, seed=1, length_proof=False)


@pytest.fixture(autouse=True)
def _no_windows():
    matplotlib.use("Agg")
    yield
    matplotlib.pyplot.close("all")


def problem_here(start=(-8.0, 0.0, 0.0)):
    return Problem(empty_map(), Vehicle(), start, (8.0, 3.0, 0.0))


def recorded(samples=SAMPLES, every=EVERY):
    """A recording of the paper's RRT*, with its answer and the numbers of samples that were reported."""
    recording, reported = Recording(every), []

    def follow(progress):
        reported.append(progress.samples)
        recording(progress)

    settings = Settings.paper(samples=samples, planning_time=60.0, seed=1)
    return recording, plan(problem_here(), settings, on_progress=follow, report_samples=every), reported


def legend(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_importing_the_planner_imports_no_matplotlib():
    code = "import sys, dubins_rrt_ros.planning; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


def test_a_plan_is_drawn_on_axes_of_its_own_or_on_those_given():
    figure = matplotlib.figure.Figure()
    axes = figure.add_subplot()
    result = plan(problem_here(), Settings(samples=20, planning_time=60.0, seed=1, preferred_clearance=0.0))
    assert result.plot(axes) is axes and result.plot() is not axes
    assert f"{result.length:.2f} m" in axes.get_title()
    assert {"free", "obstacle", "path", "swept by the vehicle"} <= set(legend(axes))
    lines = [line.get_xydata() for line in axes.lines if line.get_color() == drawing.PATH]
    assert np.array_equal(lines[0], result.poses()[:, :2])


def test_a_plan_without_a_path_shows_the_cause():
    result = plan(problem_here(start=(-9.95, 0.0, 0.0)))
    axes = result.plot()
    assert result.status.name in axes.get_title() and "why there is no path" in legend(axes) and "path" not in legend(axes)


def test_a_path_with_a_preferred_clearance_is_coloured_by_its_room():
    result = plan(problem_here(), Settings(samples=20, planning_time=60.0, seed=1, preferred_clearance=5.0))
    axes = result.plot()
    assert {"path without room", "path with preferred room"} <= set(legend(axes))
    by_room = next(lines for lines in axes.collections if lines.get_array() is not None)
    rooms = result.rooms()
    np.testing.assert_allclose(by_room.get_array(), (rooms[:-1] + rooms[1:]) / 2)
    assert rooms == pytest.approx((result.clearances() - 0.2) / 5.0)
    assert plan(problem_here(), Settings(samples=20, planning_time=60.0, preferred_clearance=0.0)).rooms() is None


def test_a_map_and_a_tree_share_axes():
    result = plan(problem_here(), Settings.paper(samples=50, planning_time=60.0, seed=1))
    axes = result.problem.map.plot()
    limits = axes.get_xlim(), axes.get_ylim()
    assert result.tree.plot(axes) is axes and (axes.get_xlim(), axes.get_ylim()) == limits
    alone = result.tree.plot()
    low, high = result.tree.poses[:, 0].min(), result.tree.poses[:, 0].max()
    assert alone.get_xlim()[0] < low < high < alone.get_xlim()[1] and alone.get_aspect() == 1.0


def test_notebooks_show_maps_trees_and_plans():
    result, before = plan(problem_here(), Settings(samples=20, planning_time=60.0, seed=1)), matplotlib.pyplot.get_fignums()
    for shown in (result, result.tree, result.problem.map):
        assert Image.open(io.BytesIO(shown._repr_png_())).format == "PNG"
    assert matplotlib.pyplot.get_fignums() == before, "a picture of a notebook is no figure of pyplot"


def test_without_matplotlib_notebooks_show_text_and_plots_say_what_to_install(monkeypatch):
    monkeypatch.setattr(pictures, "find_spec", lambda name: None)
    assert empty_map()._repr_png_() is None
    with pytest.raises(PictureError, match=re.escape("pip install 'dubins_rrt_ros[plots]'")):
        empty_map().plot()


def test_progress_is_reported_every_so_many_samples_and_changes_no_path():
    _, result, reported = recorded()
    assert set(range(EVERY, SAMPLES, EVERY)) <= set(reported)
    again = plan(result.problem, result.settings)
    assert again.path == result.path and np.array_equal(again.tree.poses, result.tree.poses)


def test_the_tree_of_a_recording_grows_up_to_the_answers():
    recording, result, _ = recorded()
    sizes = [len(frame.drawing.tree) for frame in recording._frames]
    assert sizes == sorted(sizes) and 0 < sizes[0] < sizes[-1]
    assert recording._frames[-1].samples <= result.samples


def test_a_gif_shows_every_frame_and_ends_with_the_answer(tmp_path):
    recording, result, _ = recorded()
    drawn = []
    recording.save(str(tmp_path / "search.gif"), result, drawn.append)
    animation = Image.open(tmp_path / "search.gif")
    assert drawn == list(range(1, len(drawn) + 1)) and len(drawn) >= SAMPLES // EVERY
    assert 1 < animation.n_frames <= len(drawn)  # frames that show the same are one
    first = np.array(animation.convert("RGB"))
    animation.seek(animation.n_frames - 1)
    last = np.array(animation.convert("RGB"))
    orange = [int(drawing.PATH[i:i + 2], 16) for i in (1, 3, 5)]
    assert first.shape == last.shape
    assert (np.abs(last.astype(int) - orange) < 12).all(axis=2).sum() > 300


def test_the_bound_of_an_animation_never_falls_and_is_at_last_the_answers():
    recording, result, _ = recorded(every=20)
    recording._add(replace(result, lower_bound=1.0))  # the proof of the recorded search went further
    bounds = [frame.lower_bound for frame in _SearchScreen(recording._frames)._frames]
    assert bounds == sorted(bounds) and bounds[-1] == 1.0


def test_a_page_holds_its_frames_and_needs_no_network(tmp_path):
    recording, result, _ = recorded(every=20)
    recording.save(str(tmp_path / "search.html"), result)
    page = (tmp_path / "search.html").read_text()
    assert page.count("iVBORw0KGgo") == recording.frames - 1 and not re.search(r"https?:|src=\"", page)


def test_a_video_is_encoded_or_ffmpeg_is_asked_for(tmp_path, monkeypatch):
    recording, result, _ = recorded(every=20)
    if pictures.shutil.which("ffmpeg"):
        recording.save(str(tmp_path / "search.mp4"), result)
        assert (tmp_path / "search.mp4").read_bytes()[4:8] == b"ftyp"
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(PictureError, match="install the package ffmpeg"):
        recording.save(str(tmp_path / "other.mp4"), result)


def test_of_many_frames_some_are_left_out(monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.pictures.animation.MOST_FRAMES", 20)
    recording, _, _ = recorded(samples=50, every=1)
    assert recording.frames == 20


def test_a_tour_shows_its_waypoints_and_counts_them():
    axes = matplotlib.figure.Figure().add_subplot()
    waypoints = [(-3.0, 2.0), (2.0, -1.0, 0.0), (-3.0, 2.0)]
    result = plan_through(problem_here(), waypoints, Settings(samples=20, planning_time=60.0, seed=1))
    result.plot(axes)
    assert " m over 3 waypoints, " in axes.get_title()
    assert {"1, 3", "2"} <= {text.get_text() for text in axes.texts}


def test_a_tour_is_animated_as_a_drive(tmp_path, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.pictures.animation.MOST_FRAMES", 12)
    result, drawn = plan_through(problem_here(), [(-3.0, 2.0)], Settings(samples=20, planning_time=60.0, seed=1)), []
    save_drive(str(tmp_path / "drive.gif"), result, drawn.append)
    assert drawn == list(range(1, 13))
    assert Image.open(tmp_path / "drive.gif").n_frames == 12  # none is as the one before


def drawn_poses(axes):
    """The arrows of start and goal, and their names by what they say."""
    arrows = [patch for patch in axes.patches if isinstance(patch, matplotlib.patches.Polygon)]
    return arrows, {text.get_text(): text for text in axes.texts if text.get_text() in ("start", "goal")}


def test_the_arrow_of_a_wide_vehicle_stays_in_the_picture():
    axes = matplotlib.figure.Figure().add_subplot()
    goal = (10.0, 17.5, math.pi / 2)  # 2.5 m below the upper edge
    plan(Problem(GridMap(np.zeros((100, 100)), 0.2), Vehicle(robot_radius=2.0), (10.0, 3.0, 0.0), goal), QUICK).plot(axes)
    for arrow in drawn_poses(axes)[0]:
        assert arrow.get_xy()[:, 1].max() <= axes.get_ylim()[1]


def test_a_name_is_beside_its_vehicle_and_not_on_it():
    axes = matplotlib.figure.Figure(figsize=(8, 6)).add_subplot()
    goal, car = (22.0, 4.1, -math.pi / 2), Vehicle(5.0, footprint=[[3.6, 0.9], [-0.9, 0.9], [-0.9, -0.9], [3.6, -0.9]])
    plan(Problem(load_map("parking.geojson"), car, (2.5, 8.75, 0.0), goal), QUICK).plot(axes)  # between two other cars
    axes.get_figure().canvas.draw()
    name = drawn_poses(axes)[1]["goal"].get_window_extent().transformed(axes.transData.inverted())
    body = shapely.box(21.1, 0.5, 22.9, 5.0)
    assert 0 < shapely.distance(body, shapely.box(*name.extents)) < 1.5


@pytest.mark.parametrize("heading", np.linspace(-3, 3, 7).tolist())
def test_names_are_written_on_free_space_and_within_the_picture(heading):
    grid = np.zeros((100, 100))
    grid[60:64] = 100  # a wall above the goal
    problem = Problem(GridMap(grid, 0.2), Vehicle(), (2.0, 2.0, 0.0), (10.0, 11.0, heading))
    axes = matplotlib.figure.Figure().add_subplot()
    plan(problem, Settings(planner="rrt", planning_time=60.0, seed=1)).plot(axes)
    axes.get_figure().canvas.draw()
    for name in (text for text in axes.texts if text.get_text() in ("start", "goal")):
        box = name.get_window_extent().transformed(axes.transData.inverted())
        assert not (box.y0 < 12.8 and box.y1 > 12.0), name
        assert 0 <= box.x0 < box.x1 <= 20 and 0 <= box.y0 < box.y1 <= 20
