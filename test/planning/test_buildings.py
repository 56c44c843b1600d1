"""Polygon maps of whole buildings: they plan as the same map as a grid does, whatever their scale; the raster under them."""

import math

import numpy as np
import pytest
import shapely
from support.buildings import district, office, scaled_map, serpentine, spiral
from support.cases import naive_clearance, scaled

from dubins_rrt_ros.planning import (
    ClearanceField,
    PolygonMap,
    Problem,
    Settings,
    Vehicle,
    kernels_compiled,
    plan,
    prepare,
    rasterise,
)

VEHICLE = Vehicle(turning_radius=0.8, robot_radius=0.3)
SETTINGS = Settings(seed=0, samples=200, planning_time=60.0, length_proof=False)
BUILDINGS = {
    "office": (lambda: office(6), (2.5, 2.5, 0.0), (27.5, 27.5, 1.0)),
    "serpentine": (lambda: serpentine(10), (1.0, 1.0, 0.0), (10.0, 20.8, math.pi)),
    "spiral": (lambda: spiral(4), (0.5, 0.0, math.pi), (-11.5, -11.5, 0.0)),
}
compiled = pytest.mark.skipif(not kernels_compiled, reason="takes minutes with interpreted kernels")


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("kind", BUILDINGS)
def test_polygons_plan_as_the_same_map_as_a_grid(kind):
    make, start, goal = BUILDINGS[kind]
    polygons = make()
    found, of_grid = (plan(Problem(map, VEHICLE, start, goal), SETTINGS) for map in (polygons, rasterise(polygons, 0.05)))
    assert found.solved and of_grid.solved
    # A cell that an obstacle reaches into is occupied in the grid, so that there is less room there.
    assert found.path.length <= 1.01 * of_grid.path.length
    assert found.lower_bound == pytest.approx(of_grid.lower_bound, rel=0.03)


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.25, 64])
def test_scale_makes_no_difference(factor):
    """Powers of two, so that nothing is rounded otherwise; the millimetres that are kept from obstacles are not scaled."""
    make, start, goal = BUILDINGS["office"]
    polygons = make()
    one, other = (plan(Problem(scaled_map(polygons, f), Vehicle(turning_radius=0.8 * f, robot_radius=0.3 * f),
                               (start[0] * f, start[1] * f, start[2]), (goal[0] * f, goal[1] * f, goal[2])), SETTINGS)
                  for f in (1, factor))
    assert other.path.length == pytest.approx(factor * one.path.length, rel=0.005)
    assert other.lower_bound == pytest.approx(factor * one.lower_bound, rel=0.005)


@pytest.mark.parametrize("kind", [*BUILDINGS, "district"])
def test_distances_and_bounds_of_a_building(kind):
    polygons = district(blocks=6, side=120.0) if kind == "district" else BUILDINGS[kind][0]()
    field, corners = ClearanceField(polygons), polygons.corners()
    rng = np.random.default_rng(1)
    points = rng.uniform(corners[0], corners[2], (scaled(3000), 2))
    expected = naive_clearance(polygons)(points)
    np.testing.assert_allclose(field.at(points), expected, rtol=0, atol=1e-9)
    bounds = np.asarray(field.kernel.field)[field.cells(points)]
    assert (expected[bounds < 0] == 0).all()
    assert (bounds <= expected + 1e-9)[bounds >= 0].all()
    # No more than two diagonals below, so that walls do not vanish.
    assert (bounds >= expected - math.sqrt(8) * field.kernel.resolution - 1e-6)[bounds > 0].all()


@compiled
def test_a_round_room_of_many_vertices():
    angle = np.linspace(0, 2 * math.pi, 100_000, endpoint=False)
    room = PolygonMap(shapely.Polygon(np.column_stack([10 + 9 * np.cos(angle), 10 + 9 * np.sin(angle)])))
    world = prepare(room, Vehicle(turning_radius=1.0, robot_radius=0.2))
    assert world.field.at(np.array([[10.0, 10.0], [12.0, 10.0]])) == pytest.approx([9, 7], abs=1e-6)
    assert plan(Problem(world, start=(5, 10, 0), goal=(8, 10, 0)), SETTINGS).path.length == pytest.approx(3)
