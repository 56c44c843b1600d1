"""What the pictures show, judged by their pixels."""

import math

import numpy as np
import pytest
import shapely
from matplotlib.image import imread

from dubins_rrt_ros.planning import GridMap, PolygonMap, Vehicle
from dubins_rrt_ros.planning.pictures import drawing as plots

L_SHAPE = np.array([[1.0, 1.0], [11.0, 1.0], [11.0, 6.0]])
NO_TREE, NO_PATH = np.empty((0, 2, 2)), np.empty((0, 3))


def drawing(map, *, tree=NO_TREE, path=NO_PATH, start=(1.0, 1.0, 0.0), goal=(11.0, 6.0, math.pi / 2), vehicle=None):
    return plots.Drawing(map, start, goal, vehicle or Vehicle(robot_radius=0.2), tree, path, "RRT*: 15.00 m", "3000 samples")


class Picture:
    """A picture drawn of a map, with its pixels by their place on the map."""

    def __init__(self, file, drawn):
        plots.draw(str(file), drawn)
        self.pixels = np.round(imread(file)[..., :3] * 255).astype(int)
        corners = drawn.map.corners()
        side = np.ptp(corners, axis=0).max()
        self.low = corners.min(axis=0) - 0.01 * side
        self.scale = plots.MAP_SIDE * plots.DPI / (1.02 * side)
        below = plots.BOTTOM + plots.ROW * math.ceil(len(plots.legend_entries(drawn)) / plots.COLUMNS)
        self.corner = np.array([plots.LEFT, below]) * plots.DPI

    def at(self, x, y):
        column, up = self.corner + self.scale * (np.array([x, y]) - self.low)
        return "#{:02x}{:02x}{:02x}".format(*self.pixels[len(self.pixels) - 1 - int(up), int(column)])

    def places(self, colour):
        """(n, 2) places of the pixels of a colour [m]."""
        rgb = [int(colour[i:i + 2], 16) for i in (1, 3, 5)]
        rows, columns = np.nonzero((np.abs(self.pixels - rgb) <= 2).all(axis=2))
        pixels = np.stack([columns, len(self.pixels) - 1 - rows], axis=1) + 0.5
        on_map = pixels[:, 1] > self.corner[1] - 2  # and not in the legend below
        return self.low + (pixels[on_map] - self.corner) / self.scale


@pytest.fixture
def room():
    """12 m x 8 m with a wall and, far right, a block with a free court."""
    obstacles = shapely.box(4, 3, 5, 8).union(shapely.box(7, 3, 10, 6).difference(shapely.box(8, 4, 9, 5)))
    return PolygonMap(shapely.box(0, 0, 12, 8).difference(obstacles))


def test_polygons_with_holes_and_courts_are_drawn_where_they_are(tmp_path, room):
    picture = Picture(tmp_path / "room.png", drawing(room))
    for place, colour in {(4.5, 5): plots.OBSTACLE, (7.5, 4.5): plots.OBSTACLE, (8.5, 4.5): plots.FREE,
                          (2, 5): plots.FREE, (6, 5): plots.FREE, (-0.06, 4): plots.OBSTACLE}.items():
        assert picture.at(*place) == colour, place


@pytest.mark.parametrize("hole", [[(4, 3), (6, 3), (6, 5), (4, 5)], [(4, 3), (4, 5), (6, 5), (6, 3)]])
def test_a_hole_is_an_obstacle_whichever_way_its_ring_runs(tmp_path, hole):
    shell = [(0, 0), (12, 0), (12, 8), (0, 8)]
    picture = Picture(tmp_path / "hole.png", drawing(PolygonMap(shapely.Polygon(shell, [hole]))))
    assert picture.at(5, 4) == plots.OBSTACLE and picture.at(3, 4) == plots.FREE


def test_the_path_is_drawn_to_scale_on_both_axes(tmp_path, room):
    picture = Picture(tmp_path / "path.png", drawing(room, path=L_SHAPE, start=(1, 7, 0), goal=(3, 7, 0)))
    places = picture.places(plots.PATH)
    assert places.min(axis=0) == pytest.approx([1, 1], abs=0.05)
    assert places.max(axis=0) == pytest.approx([11, 6], abs=0.05)
    assert picture.at(8, 1) == picture.at(11, 3) == plots.PATH


def test_the_swept_disc_has_the_vehicles_width(tmp_path, room):
    picture = Picture(tmp_path / "band.png", drawing(room, path=L_SHAPE))
    assert picture.at(6, 1.17) != plots.FREE and picture.at(6, 0.83) != plots.FREE
    assert picture.at(6, 1.23) == picture.at(6, 0.77) == plots.FREE


def test_a_footprint_is_drawn_with_all_that_it_sweeps(tmp_path, room):
    """Straight on it is 0.8 m wide; turning on, the corner ahead swings out."""
    vehicle = Vehicle(turning_radius=2.0, footprint="[[2, 0.4], [-0.4, 0.4], [-0.4, -0.4], [2, -0.4]]")
    turn = np.linspace(0, math.pi / 2, 40)
    arc = np.column_stack([6 + 2 * np.sin(turn), 2.9 - 2 * np.cos(turn), turn])
    path = np.vstack([[2.0, 0.9, 0.0], arc])
    picture = Picture(tmp_path / "swept.png", drawing(room, path=path, start=path[0], goal=(2.0, 7.0, math.pi), vehicle=vehicle))
    assert picture.at(4.5, 1.25) != plots.FREE and picture.at(4.5, 1.35) == plots.FREE
    corner = np.array([6, 2.9]) + math.hypot(2, 2.4) * np.array([math.cos(-math.pi / 8), math.sin(-math.pi / 8)])
    outwards = (corner - [6, 2.9]) / math.hypot(*(corner - [6, 2.9]))
    assert picture.at(*(corner - 0.05 * outwards)) != plots.FREE
    assert picture.at(*(corner + 0.05 * outwards)) == plots.FREE
    assert picture.at(0.5, 7.3) != plots.FREE and picture.at(2.3, 7.3) != plots.FREE and picture.at(2.5, 7.3) == plots.FREE


def test_a_point_is_drawn_too(tmp_path, room):
    picture = Picture(tmp_path / "point.png", drawing(room, path=L_SHAPE, vehicle=Vehicle(robot_radius=0.0)))
    assert picture.at(6, 1) == plots.PATH and picture.at(6, 1.08) == plots.FREE


def test_without_a_path_none_is_drawn(tmp_path, room):
    assert len(Picture(tmp_path / "none.png", drawing(room)).places(plots.PATH)) == 0


def test_the_tree_is_thin_and_under_the_path(tmp_path, room):
    tree = np.array([[[1.0, 2.0], [3.0, 2.0]], [[6.0, 0.2], [6.0, 2.0]]])
    picture = Picture(tmp_path / "tree.png", drawing(room, tree=tree, path=L_SHAPE))
    assert picture.at(2, 2) != plots.FREE and picture.at(2, 2.03) == plots.FREE
    assert picture.at(6, 1) == plots.PATH


def test_start_and_goal_point_along_their_headings(tmp_path, room):
    picture = Picture(tmp_path / "poses.png", drawing(room))
    # The tip is 4.5 % of the view ahead of the pose.
    assert picture.at(1.0 + 0.4, 1.0) == plots.START
    assert picture.at(11.0, 6.0 + 0.4) == plots.GOAL


def test_a_grid_is_drawn_with_its_yaw_and_its_unknown_cells(tmp_path):
    data = np.zeros((40, 80), np.int8)
    data[:, 60:] = 100
    data[30:, :20] = -1
    grid = GridMap(data, 0.1, (5.0, 2.0, math.pi / 2))
    picture = Picture(tmp_path / "grid.png", drawing(grid, start=(3, 3, 0), goal=(2, 6, 0)))
    for cell_place, colour in {(7.0, 2.0): plots.OBSTACLE, (1.0, 3.5): plots.UNKNOWN, (4.5, 3.0): plots.FREE}.items():
        x, y = grid.to_map_frame(np.array(cell_place))
        assert picture.at(x, y) == colour, cell_place


def test_a_picture_of_vectors_holds_the_path_as_lines(tmp_path, room):
    file = tmp_path / "room.svg"
    plots.draw(str(file), drawing(room, path=L_SHAPE))
    text = file.read_text()
    assert text.lstrip().startswith("<?xml") and plots.PATH in text


def test_a_narrow_map_leaves_room_for_the_title(tmp_path):
    corridor = PolygonMap(shapely.box(0, 0, 1, 40))
    plots.draw(str(tmp_path / "narrow.png"), drawing(corridor, start=(0.5, 1, 0), goal=(0.5, 9, 0)))
    height, width = imread(tmp_path / "narrow.png").shape[:2]
    assert width >= plots.WIDTH * plots.DPI - 1 and height > width


def test_the_cause_of_a_failure_is_marked_where_it_is(tmp_path, room):
    picture = Picture(tmp_path / "culprit.png", drawing(room)._replace(location=(6.0, 5.0)))
    assert picture.places(plots.FAILURE).mean(axis=0) == pytest.approx([6, 5], abs=0.05)
    assert len(Picture(tmp_path / "none.png", drawing(room)).places(plots.FAILURE)) == 0
