"""Chains of arcs that lack clearance, or miss the goal, are given the lengths that they should have."""

import math

import numpy as np
import pytest
import shapely
from support.cases import needs_compiled, path_over

from dubins_rrt_ros.evaluation.families.problems import constructed
from dubins_rrt_ros.planning import ClearanceField, DubinsCurve, Path, PolygonMap, Problem, Settings, Vehicle, audit_path, plan
from dubins_rrt_ros.planning._kernels.arc_fit import ArcFit
from dubins_rrt_ros.planning._kernels.cholesky import solve_definite
from dubins_rrt_ros.planning.collision.raster import CLEARANCE_MARGIN
from dubins_rrt_ros.planning.curves.dubins import SIDES, WORDS
from dubins_rrt_ros.planning.plan_file import read_request, to_document
from dubins_rrt_ros.planning.search import repair as repair_module
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.narrow_runs import NarrowRuns
from dubins_rrt_ros.planning.search.repair import repaired
from dubins_rrt_ros.planning.work import Work

VEHICLE = Vehicle(turning_radius=1.0, robot_radius=0.2)
#: Room beside the path along the middle of the tunnel [m].
SPARE = 0.01
POSES = [(0.0, 0.0, 0.0), (2.0, 1.5, 2.0), (0.0, 3.5, 1.0), (3.0, 5.0, -0.5)]


@pytest.fixture(scope="module")
def middle():
    return path_over(POSES, VEHICLE.turning_radius)


@pytest.fixture(scope="module")
def tunnel(middle):
    """A map that leaves the vehicle a tunnel along the path, which is longer than that at both ends."""
    return PolygonMap(shapely.LineString(middle.poses(0.002)[:, :2]).buffer(VEHICLE.robot_radius + SPARE, quad_segs=64))


def spoilt(path, seed, share=0.03):
    """The same chain with other lengths of its arcs, so that it neither fits the tunnel nor ends at the goal."""
    factors = 1 + np.random.default_rng(seed).uniform(-share, share, path.lengths.shape)
    return Path(path.waypoints, path.words, path.lengths * factors, path.radius)


def repair(path, world_map, work=None, is_free=None, vehicle=VEHICLE):
    field = ClearanceField(world_map)
    checker = field.collision_checker(vehicle)

    def motions_are_free(fitted):
        return all(checker.is_motion_free(curve.start, curve.radius, curve.index, curve.lengths) for curve in fitted.curves)

    return repaired(path, field.kernel, vehicle.required_clearance + 1.4 * CLEARANCE_MARGIN, 0.05, is_free or motions_are_free,
                    work or Work())


@needs_compiled
@pytest.mark.parametrize("seed", range(3))
def test_a_path_with_other_lengths_is_led_through_the_tunnel(middle, tunnel, seed):
    path = repair(spoilt(middle, seed), tunnel)
    path.check()
    assert (path.start, path.end) == (middle.start, middle.end)
    assert audit_path(path, Problem(tunnel, VEHICLE, middle.start, middle.end)).ok
    assert path.length == pytest.approx(middle.length, rel=0.02)


@needs_compiled
def test_the_same_path_needs_no_iteration_to_speak_of(middle, tunnel):
    work = Work()
    assert repair(middle, tunnel, work).length == pytest.approx(middle.length, rel=1e-6)
    assert work.done < 10


@needs_compiled
def test_where_the_vehicle_does_not_fit_there_is_none(middle, tunnel):
    wider = Vehicle(turning_radius=1.0, robot_radius=VEHICLE.robot_radius + 2 * SPARE)
    assert repair(spoilt(middle, 1), tunnel, vehicle=wider) is None


@needs_compiled
def test_a_path_that_is_not_free_between_the_samples_is_none(middle, tunnel):
    asked = []
    assert repair(middle, tunnel, is_free=asked.append) is None
    assert 1 <= len(asked) <= 2


@needs_compiled
@pytest.mark.parametrize("seed", range(4))
def test_a_chain_that_is_far_from_any_path_costs_little(middle, tunnel, seed, monkeypatch):
    """A step of the fit can lead anywhere; a chain of kilometres would have millions of samples."""
    lengths = []

    class Recorded:
        """The residuals, which note the lengths of the chains that they are asked for."""

        def __init__(self, *args):
            self.fit = ArcFit(*args)

        def __getattr__(self, name):
            return getattr(self.fit, name)

        def begin(self, tried):
            lengths.append(float(tried.sum()))
            return self.fit.begin(tried)

    monkeypatch.setattr(repair_module, "ArcFit", Recorded)
    monkeypatch.setattr(repair_module, "HOPELESS", math.inf)
    path = spoilt(middle, seed, share=0.9)
    repair(path, tunnel)
    assert 0 < max(lengths) <= repair_module.MOST_LONGER * path.length


def with_superfluous_arcs(path, seed, length=0.1):
    """The same chain with a turn that way and back after each curve; it fits where these get the length 0."""
    turns = [SIDES[letter] for word in path.words[1:] for letter in WORDS[word]]
    lengths = path.lengths[1:].ravel()
    rng = np.random.default_rng(seed)
    words, parts, poses = [0], [(0.0, 0.0, 0.0)], [path.start]
    for turn, whole in zip(turns, lengths, strict=True):
        for each, part in ((turn, whole), *((side, length * float(rng.uniform(0.5, 1.5))) for side in rng.permutation([1, -1]))):
            word = "LSL" if each >= 0 else "RSR"
            curve = DubinsCurve(poses[-1], path.radius, word, (0.0, part, 0.0) if each == 0 else (part, 0.0, 0.0))
            words.append(WORDS.index(word))
            parts.append(curve.lengths)
            poses.append(curve.end)
    return Path(np.array(poses), np.array(words, np.int8), np.array(parts), path.radius)


@needs_compiled
@pytest.mark.parametrize("seed", range(3))
def test_arcs_that_no_path_needs_get_no_length(middle, tunnel, seed):
    chain = with_superfluous_arcs(middle, seed)
    assert math.dist(chain.end[:2], middle.end[:2]) > 0.05  # it does not end where it should
    waypoints = np.vstack([chain.waypoints[:-1], middle.waypoints[-1:]])
    path = repair(Path(waypoints, chain.words, chain.lengths, chain.radius), tunnel)
    assert audit_path(path, Problem(tunnel, VEHICLE, middle.start, middle.end)).ok
    assert path.length == pytest.approx(middle.length, rel=0.02)


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.array([(0.3, 0.1, -0.05), (-0.2, 0.0, 0.02)])], ids=["disc", "points"])
def test_the_normal_equations_are_those_of_the_residuals(middle, tunnel, points):
    """By central differences of the cost, whose derivative by a length is twice the sum of residuals times derivatives."""
    turns = np.array([SIDES[letter] for word in middle.words[1:] for letter in WORDS[word]], np.int32)
    fit = ArcFit(ClearanceField(tunnel).kernel, 1.0, middle.start, middle.end, turns, points)
    lengths = middle.lengths[1:].ravel() * 1.02 + 0.01
    fit.require(0.21, 0.1, 2 * float(lengths.sum()))

    def cost(lengths):
        total = fit.begin(lengths)
        while not fit.measured:
            total = fit.measure(total, math.inf)
        return total

    gradient, curvature = np.zeros(len(turns)), np.zeros((len(turns), len(turns)))
    assert cost(lengths) > 1e-3
    while not fit.differentiated:
        fit.differentiate(gradient, curvature)
    for i in range(len(turns)):
        step = np.zeros(len(turns))
        step[i] = 1e-6
        difference = cost(lengths + step) - cost(lengths - step)
        assert difference / 4e-6 == pytest.approx(gradient[i], rel=1e-3, abs=1e-4)
    assert np.array_equal(curvature, curvature.T)
    assert np.linalg.eigvalsh(curvature).min() > -1e-9


@needs_compiled
def test_a_fit_with_many_samples_takes_its_course_in_slices(middle, tunnel):
    """So that the work may be over soon, whatever the length of the path is in turning radii."""
    path, work = spoilt(middle, 2), Work()
    fit = repair_module._Fit(path, ClearanceField(tunnel).kernel, repair_module.DISC, work)
    fit.run(0.2007, 60, 5e-4, 1e-9)
    assert fit.is_done and work.done > 100
    assert fit.path().length == pytest.approx(repair(path, tunnel).length, rel=1e-3)


def test_a_chain_of_very_many_samples_is_left_as_it_is():
    """Its samples would take gigabytes, and those of one arc time that no deadline ends."""
    line = path_over([(0.0, 0.0, 0.0), (600.0, 0.0, 0.0)], VEHICLE.turning_radius)
    work = Work()
    assert repair(line, PolygonMap(shapely.box(-1, -1, 601, 1)), work) is None
    assert work.done == 0


@pytest.mark.parametrize(("radius", "same"), [(0.0, True), (0.2, False)])
def test_what_is_not_repaired_is_judged_by_the_checker_itself(middle, tunnel, radius, same):
    """A point can need no less clearance than none; its paths passed by a checker that knew no test of the user's."""
    problem, field = Problem(tunnel, Vehicle(1.0, radius), middle.start, middle.end), ClearanceField(tunnel)
    checker = field.collision_checker(problem.vehicle)
    runs = NarrowRuns(problem, 0, field, checker, CostToGo.to_goal(problem, field), np.array([problem.goal]))
    assert (runs._relaxed_checker(0.1) is checker) == same
    assert (runs.repaired(middle, Work()) is middle) == same


def test_where_no_step_is_to_be_had_there_is_no_path(middle, tunnel, monkeypatch):
    monkeypatch.setattr(repair_module, "solve_definite", lambda *_: False)
    assert repair(spoilt(middle, 1), tunnel) is None


def test_it_ends_with_its_work(middle, tunnel):
    for limit in (0, 3):
        work = Work(limit=limit)
        assert repair(spoilt(middle, 1), tunnel, work) is None
        assert work.done == limit


@needs_compiled
@pytest.mark.parametrize("number", [34, *(pytest.param(number, marks=pytest.mark.slow) for number in (12, 18, 24, 63))])
def test_a_tube_that_leaves_millimetres_is_soon_driven_through(number):
    """In units of work, as no clock is asked: without the repair these take millions. Tube 34 crosses itself."""
    case = constructed("tube", 0, number)
    answer = plan(case.problem, Settings(planner="rrt", seed=0, planning_time=600.0, preferred_clearance=0.0))
    assert answer.found_by == "hybrid_astar" and answer.samples < 1000
    assert answer.work.search < 30_000
    assert answer.length < 1.01 * case.length
    again = plan(*read_request(to_document(answer, "tube"), case.problem.map))
    assert again.path == answer.path and math.isclose(again.length, answer.length)


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_a_definite_system_is_solved(size):
    rng = np.random.default_rng(size)
    factors, solution = rng.normal(size=(size, size + 1)), rng.normal(size=size)
    matrix = factors @ factors.T + 1e-3 * np.eye(size)
    values, lower = matrix @ solution, np.where(np.tri(size) > 0, matrix, math.nan)  # the rest does not count
    assert solve_definite(lower, values)
    assert values == pytest.approx(solution, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("matrix", [[[0.0]], [[1.0, 2.0], [2.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]], [[math.nan]], [[-1.0]]])
def test_a_system_that_is_not_definite_is_not_solved(matrix):
    assert not solve_definite(np.array(matrix), np.ones(len(matrix)))
