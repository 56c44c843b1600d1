"""Every option of Settings, Vehicle and Problem: what it takes, and what it says when it does not."""

import inspect
import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from dubins_rrt_ros import planning
from dubins_rrt_ros.planning import GridMap, InvalidPose, OptionError, Problem, Settings, Vehicle, checked_pose, options, values

MAP = GridMap(np.zeros((4, 4)), 1.0)
MAKE = {Settings: Settings, Vehicle: Vehicle,
        Problem: lambda **fields: Problem(MAP, Vehicle(), (1, 1, 0), (2, 2, 0), **fields)}
OPTIONS = [(cls, item) for cls in MAKE for item in options(cls)]
of_type = {kind: [(cls, item) for cls, item in OPTIONS if item.type is kind] for kind in (float, int, bool, str)}
#: Wheelbase and steering angle go together only.
PAIR = {"wheelbase": {"max_steering_angle": 0.5}, "max_steering_angle": {"wheelbase": 10.0}}


def names(kind):
    return pytest.mark.parametrize("cls, item", of_type[kind], ids=[f"{c.__name__}.{i.name}" for c, i in of_type[kind]])


def make(cls, item, value):
    return MAKE[cls](**{item.name: value}, **(PAIR.get(item.name, {}) if value else {}))


def assert_refused(cls, item, value):
    with pytest.raises(OptionError) as refusal:
        make(cls, item, value)
    message = str(refusal.value)
    assert message.startswith(f"{item.name} is {value!r}; it takes ")
    assert item.allowed() in message
    assert item.help in message
    assert "\n" not in message


def test_the_options_are_those_of_the_contract():
    assert {item.name for item in options(Settings)} >= {
        "planner", "samples", "planning_time", "goal_bias", "step_size", "heading_sampling", "path_spacing", "seed"}
    assert [item.name for item in options(Vehicle)] == [
        "turning_radius", "robot_radius", "footprint", "wheelbase", "max_steering_angle"]
    assert [item.name for item in options(Problem)] == [
        "goal_tolerance_xy", "goal_tolerance_yaw", "any_goal_heading", "allow_unknown", "start_slack"]
    defaults = values(Settings())
    assert (defaults["planner"], defaults["samples"]) == ("rrt_star", 3000)
    assert (defaults["planning_time"], defaults["seed"]) == (1.0, -1)
    assert values(Vehicle())["turning_radius"] == 1.0


@pytest.mark.parametrize("cls, item", OPTIONS, ids=[f"{c.__name__}.{i.name}" for c, i in OPTIONS])
def test_description_and_default(cls, item):
    assert values(MAKE[cls]())[item.name] == item.default
    assert item.describe().startswith(item.help)
    assert item.allowed() in item.describe()
    assert item.unit in item.describe()
    assert "\n" not in item.describe()


@names(float)
def test_a_number_takes_its_range_and_integers(cls, item):
    for value in (item.low, item.high):
        assert getattr(make(cls, item, value), item.name) == value
    whole = math.ceil(max(item.low, min(item.high, 1)))
    if item.low <= whole <= item.high:
        found = getattr(make(cls, item, whole), item.name)
        assert type(found) is float
        assert found == whole
    beyond = math.nextafter(item.low, -math.inf), math.nextafter(item.high, math.inf)
    for value in (*beyond, math.nan, math.inf, -math.inf):
        assert_refused(cls, item, value)
    for value in ("1", None, True, [1.0], 1j):
        assert_refused(cls, item, value)
    for kind in (np.float32, np.float64, np.int64, np.array):
        taken = getattr(make(cls, item, kind(whole)), item.name) if item.low <= whole <= item.high else float(whole)
        assert type(taken) is float and taken == whole
    for value in (np.float64(math.nan), np.float64(beyond[1]), np.True_, np.array([1.0]), np.complex128(1)):
        with pytest.raises(OptionError, match=f"^{item.name} is .*; it takes "):
            make(cls, item, value)


@names(int)
def test_an_integer_takes_its_range(cls, item):
    for value in (item.low, item.high):
        assert getattr(make(cls, item, value), item.name) == value
    for value in (item.low - 1, item.high + 1, 1.0, 1.5, math.nan, "1", None, True):
        assert_refused(cls, item, value)
    taken = getattr(make(cls, item, np.arange(item.low, item.low + 2)[1]), item.name)
    assert type(taken) is int and taken == item.low + 1
    for value in (np.float64(1), np.True_):
        with pytest.raises(OptionError, match=f"^{item.name} is .*; it takes "):
            make(cls, item, value)


@names(bool)
def test_a_switch_takes_true_and_false(cls, item):
    for value in (True, False):
        assert getattr(make(cls, item, value), item.name) is value
        assert getattr(make(cls, item, np.bool_(value)), item.name) is value
    for value in (1, 0, "true", None, 1.0):
        assert_refused(cls, item, value)


@pytest.mark.parametrize("cls, item", [(cls, item) for cls, item in of_type[str] if item.choices])
def test_a_choice_takes_its_choices(cls, item):
    for value in item.choices:
        assert getattr(make(cls, item, value), item.name) == value
    for value in ("", "RRT", item.choices[0] + " ", None, 1):
        assert_refused(cls, item, value)


def test_integers_that_no_float_can_hold_are_refused_in_short():
    for make in (lambda: Settings(samples=10**400), lambda: Settings(goal_bias=-10**400), lambda: Vehicle(robot_radius=10**6000)):
        with pytest.raises(OptionError, match=" is .*; it takes ") as refusal:
            make()
        assert len(str(refusal.value)) < 400


def test_long_values_are_refused_in_short():
    for value in ("n" * 10**6, {"k" * 999: "v" * 999}, [["n" * 999] * 999] * 999):
        with pytest.raises(OptionError, match="^planner is ") as refusal:
            Settings(planner=value)
        assert len(str(refusal.value)) < 400


def test_options_are_frozen():
    with pytest.raises(FrozenInstanceError):
        Settings().samples = 5
    with pytest.raises(FrozenInstanceError):
        Vehicle().turning_radius = 5.0


def test_turning_radius_of_a_wheelbase():
    vehicle = Vehicle(wheelbase=2.7, max_steering_angle=0.6)
    assert vehicle.turning_radius == pytest.approx(2.7 / math.tan(0.6))
    assert Vehicle(wheelbase=1, max_steering_angle=math.pi / 4).turning_radius == pytest.approx(1)


@pytest.mark.parametrize("half", [{"wheelbase": 2.7}, {"max_steering_angle": 0.6}])
def test_wheelbase_and_steering_angle_go_together(half):
    with pytest.raises(OptionError, match=r"wheelbase is .* and max_steering_angle .*; set both at once, or neither"):
        Vehicle(**half)


@pytest.mark.parametrize("pose", [
    (0, 0), (0, 0, 0, 0), (math.nan, 0, 0), (0, math.inf, 0), (0, 0, -math.inf), "abc", None, 5, (10**400, 0, 0),
    (None, 0, 0), ("x", 0, 0), (), "123", b"123", {1, 2, 3}])
@pytest.mark.parametrize("end", ["start", "goal"])
def test_invalid_pose(end, pose):
    ends = {"start": (1, 1, 0), "goal": (2, 2, 0), end: pose}
    with pytest.raises(InvalidPose, match=f"^The {end} pose is .*; give three finite numbers: x .*, y .*, yaw"):
        Problem(MAP, Vehicle(), **ends)


def test_poses_become_floats():
    problem = Problem(MAP, Vehicle(), np.array([1, 1, 0]), [np.float32(2), np.int8(2), 1], np.float64(0.5))
    assert problem.goal_tolerance_xy == 0.5
    assert problem.start == (1.0, 1.0, 0.0)
    assert all(type(number) is float for number in problem.start + problem.goal)
    assert checked_pose("start", (1, 2, 3)) == (1.0, 2.0, 3.0)


def test_a_yaw_that_was_likely_meant_in_degrees_is_doubted():
    with pytest.warns(UserWarning, match="^the goal pose has the yaw 90 rad; did you mean 1.5708?") as warned:
        problem = Problem(MAP, Vehicle(), (1, 1, 2 * math.pi), (2, 2, 90))
    assert problem.goal == (2.0, 2.0, 90.0) and len(warned) == 1 and warned[0].filename == __file__


@pytest.mark.parametrize(("make", "asks"), [
    (lambda: Vehicle(wheelbase=1.0, max_steering_angle=28), "; did you mean 0.4887 (28 degrees)?"),
    (lambda: Problem(MAP, Vehicle(), (1, 1, 0), (2, 2, 0), goal_tolerance_yaw=10.0), "; did you mean 0.1745 (10 degrees)?"),
    (lambda: Vehicle(wheelbase=1.0, max_steering_angle=200), None),
    (lambda: Vehicle(turning_radius=-28), None)], ids=["steering", "tolerance", "too much", "no angle"])
def test_an_angle_out_of_range_is_asked_about_in_degrees(make, asks):
    with pytest.raises(OptionError) as refused:
        make()
    assert str(refused.value).endswith(asks) if asks else "did you mean" not in str(refused.value)


def test_what_counts_as_an_exact_goal():
    make = MAKE[Problem]
    assert make().exact_goal
    assert not make(goal_tolerance_xy=0.1).exact_goal
    assert not make(goal_tolerance_yaw=0.1).exact_goal
    assert not make(any_goal_heading=True).exact_goal
    assert make(any_goal_heading=True).yaw_tolerance == math.pi
    assert make(goal_tolerance_yaw=0.3).yaw_tolerance == 0.3


@pytest.mark.parametrize("cls", MAKE)
def test_help_shows_every_option_with_unit_and_range(cls):
    text = " ".join(cls.__doc__.split())
    for item in options(cls):
        assert f"{item.name} (" in text and f": {item.describe()}" in text


def test_a_problem_takes_its_options_with_their_defaults():
    """Its constructor is written out, to take a World."""
    defaults = {name: parameter.default for name, parameter in inspect.signature(Problem).parameters.items()}
    assert {item.name: item.default for item in options(Problem)}.items() <= defaults.items()


def test_all_errors_have_one_base():
    raised = [item for item in vars(planning).values() if isinstance(item, type) and issubclass(item, Exception)]
    assert len(raised) == 12 and all(issubclass(error, planning.PlanningError) for error in raised)
