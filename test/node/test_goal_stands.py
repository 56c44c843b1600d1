"""The goal stands until it is reached, cancelled or replaced: the contract's sentences, each with its test. By the executable."""

import math
import time
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.srv import GetMap
from std_srvs.srv import Trigger
from support.harness import poses_of, values_of
from support.walls import CLOSED, DETOUR, FREE, HARMLESS, publish, wait_for_path_around, walled
from support.yard import GOAL, START

QUICK = {"samples": 300, "planning_time": 2.0, "seed": 1}
LONG = {"samples": 10_000_000, "planning_time": 30.0}
OTHER_GOAL, THIRD_GOAL, FOURTH_GOAL = (8.5, 2.0, 0.0), (8.5, 8.0, 0.0), (6.0, 6.8, math.pi)
#: A corridor around FOURTH_GOAL, which is on the way out of it: it is free, but a car that drives in cannot turn round.
NARROW = walled(np.s_[60:62, 50:], np.s_[74:76, 50:])
#: A wall with a gap in its middle, so that the way around DETOUR is no shorter.
GAP = walled(np.s_[:44, 50:52], np.s_[56:, 50:52])
#: On the way that was driven already, and on the vehicle's place when it has not moved.
BEHIND = walled(np.s_[45:55, 30:33])


class Drive:
    """One planner that hears maps, starts and goals, and its client."""

    def __init__(self, process, client):
        self.process, self.client = process, client

    def show(self, cells):
        publish(self.client, self.process, cells)

    def start(self, pose):
        """The start is in use when this returns: services are answered after what was sent before and has come."""
        self.client.send("start_pose", pose)
        for _ in range(3):
            self.client.call(GetMap, "get_map")

    def go(self, goal, **wanted):
        """Send a goal; the values of the first status of a request that is newer than all before, with the wanted values."""
        plan_id = self.client.next_id
        self.client.send("goal_pose", goal)
        return self.client.status_of(plan_id, **wanted)

    def all_is_said(self):
        """Whatever was begun before has been answered."""
        assert len(self.client.plan(START, START)[0].poses) == 1

    @property
    def plan_ids(self):
        """Those of goals."""
        told = [values_of(status) for status in self.client.statuses]
        return {int(values["plan_id"]) for values in told if values["request"] == "goal"} - self.client.marks

    def events(self, plan_id):
        return [(status.level, values_of(status)["error_name"], status.message) for status in self.client.statuses
                if values_of(status)["plan_id"] == str(plan_id)]

    @property
    def ends(self):
        """Where each path ended, None for an empty one."""
        return [tuple(poses_of(path)[-1, :2]) if path.poses else None for path in self.client.paths]


@pytest.fixture
def drive(planners):
    def begin(cells=FREE, start=START, **parameters):
        drive = Drive(planners.start(**QUICK | parameters), planners.client())
        drive.show(cells)
        drive.start(start)
        return drive
    return begin


def test_a_newer_goal_waits_until_the_request_under_way_has_a_path_or_none_and_of_the_waiting_ones_the_newest_is_kept(drive):
    drive = drive(NARROW, **LONG | {"planning_time": 1.5})
    client = drive.client
    first, *_, last = map(client.begin_goal, (FOURTH_GOAL, GOAL, THIRD_GOAL, OTHER_GOAL))  # the first takes its whole time
    assert not drive.plan_ids, "nothing was answered yet"
    client.status_of(last, error_name="NONE")
    client.cancel()
    assert set(drive.ends) <= {OTHER_GOAL[:2], None}
    assert drive.ends[-1] == OTHER_GOAL[:2]
    assert {last} <= drive.plan_ids <= {first, last}


def test_a_goal_that_waits_is_answered_when_it_is_cancelled(drive):
    drive = drive(NARROW, **LONG)
    client = drive.client
    plan_ids = [client.begin_goal(goal) for goal in (FOURTH_GOAL, GOAL)]
    assert client.call(Trigger, "cancel").success
    assert [client.status_of(plan_id)["error_name"] for plan_id in plan_ids] == ["CANCELLED", "CANCELLED"]


def test_a_goal_equal_to_the_standing_one_does_not_disturb_it_and_is_planned_anew_once_that_has_ended(drive):
    drive = drive(**LONG)
    client = drive.client
    plan_id = int(drive.go(GOAL, error_name="NONE")["plan_id"])
    for offset in (0.0, 1e-7, -1e-7):
        client.send("goal_pose", (GOAL[0] + offset, *GOAL[1:]))
        client.call(GetMap, "get_map")
    drive.start(moved := (1.6, 5.1, 0.0))
    drive.all_is_said()
    assert drive.plan_ids == {plan_id}
    client.call(Trigger, "cancel")
    client.wait_for(lambda: "cancelled" in client.statuses[-1].message, "the goal's end")
    client.paths.clear()
    assert drive.go(GOAL, error_name="NONE")["plan_id"] == str(plan_id + 2)  # one was get_plan's
    client.wait_for(lambda: client.paths, "the path")
    assert tuple(poses_of(client.paths[0])[0]) == moved


def test_a_failure_is_told_first_then_once_what_is_waited_for_and_it_is_tried_again_silently_when_that_comes(drive):
    drive = drive(CLOSED)
    client = drive.client
    plan_id = drive.go(GOAL, error_name="NO_VALID_PATH")["plan_id"]
    client.wait_for(lambda: drive.events(plan_id)[1:], "what it waits for")
    drive.show(CLOSED | HARMLESS)
    drive.start((1.6, 5.0, 0.0))
    drive.all_is_said()
    first, second = drive.events(plan_id)
    assert first[:2] == (DiagnosticStatus.ERROR, "NO_VALID_PATH")
    assert second[:2] == (DiagnosticStatus.WARN, "NO_VALID_PATH")
    assert second[2] == ("Waiting for a map or a start: the goal failed with the present ones, and is planned again when another "
                         f"comes. {first[2]}")
    assert drive.ends[-1] is None
    drive.show(FREE)
    client.status_of(int(plan_id), error_name="NONE")
    client.wait_for(lambda: drive.ends[-1] == GOAL[:2], "the path")


@pytest.mark.parametrize("spot", [(5.1, 5.0, 0.0), (-1.0, 5.0, 0.0)], ids=["START_OCCUPIED", "START_OUTSIDE_MAP"])
def test_a_failure_that_a_start_can_cure_is_tried_again_when_one_comes(drive, spot):
    drive = drive(DETOUR, start=spot)
    told = drive.go(GOAL)
    assert told["error_name"] in ("START_OCCUPIED", "START_OUTSIDE_MAP")
    drive.start(START)
    assert drive.client.status_of(int(told["plan_id"]), error_name="NONE")["level"] == DiagnosticStatus.OK


def test_a_start_that_comes_after_its_goal_was_refused_is_planned_from(planners, map_file):
    planners.start(map_file=map_file, **QUICK)
    client = planners.client()
    client.send("goal_pose", GOAL)
    client.status_of(1, error_name="NO_START")
    client.wait_for(lambda: client.statuses[-1].message.startswith("Waiting for a start: "), "what it waits for")
    client.send("start_pose", START)
    client.status_of(1, error_name="NONE")


def test_a_failure_that_nothing_can_cure_is_told_alone_and_a_cancelled_goal_is_not_tried_again(drive):
    drive = drive(CLOSED)
    client = drive.client
    plan_id = drive.go((float("nan"), 1.0, 0.0), error_name="INVALID_POSE")["plan_id"]
    drive.start(START)
    assert len(drive.events(plan_id)) == 1
    plan_id = drive.go(GOAL, error_name="NO_VALID_PATH")["plan_id"]
    client.wait_for(lambda: drive.events(plan_id)[1:], "what it waits for")
    assert client.call(Trigger, "cancel").message == "Cancelled before a first path: the goal waited for a map or a start."
    drive.show(FREE)
    drive.start(START)
    drive.all_is_said()
    assert [name for _, name, _ in drive.events(plan_id)] == ["NO_VALID_PATH", "NO_VALID_PATH", "CANCELLED"]
    assert drive.ends[-1] is None


def test_another_failure_of_a_retry_is_told(drive):
    drive = drive(CLOSED)
    client = drive.client
    plan_id = int(drive.go(GOAL, error_name="NO_VALID_PATH")["plan_id"])
    drive.start((-1.0, 5.0, 0.0))
    client.status_of(plan_id, error_name="START_OUTSIDE_MAP")
    drive.start(START)
    client.wait_for(lambda: drive.events(plan_id)[-1][:2] == (DiagnosticStatus.WARN, "NO_VALID_PATH"), "the first failure again")


@pytest.mark.parametrize("how", [{"replan_rate": 10.0}, {"replan_on_map_change": True}], ids=["by rate", "by map"])
def test_a_path_that_is_planned_again_replaces_the_rest_only_where_it_is_better_by_the_gain(drive, how):
    drive = drive(DETOUR, **how)
    client = drive.client
    plan_id = int(drive.go(GOAL, samples="300")["plan_id"])
    drive.show(DETOUR | HARMLESS)
    drive.start((1.52, 5.0, 0.0))
    time.sleep(0.5)  # in which it is planned again five times
    drive.all_is_said()
    assert drive.plan_ids == {plan_id}
    shown = len(client.paths)
    drive.show(GAP)
    told = client.status_of(plan_id + 2, error_name="NONE")  # one was get_plan's
    client.wait_for(lambda: client.paths[shown:], "the path through the gap")
    assert poses_of(client.paths[shown])[0] == pytest.approx((1.52, 5.0, 0.0))
    assert float(told["path_length"]) < 7.5
    assert all(path.poses for path in client.paths[shown:])


def test_the_gain_is_a_parameter(drive):
    drive = drive(DETOUR, replan_rate=10.0, replan_gain=0.9)
    client = drive.client
    drive.go(GOAL, samples="300")
    drive.show(FREE)
    time.sleep(0.5)
    shown = len(client.paths)
    drive.all_is_said()
    assert len(client.paths) == shown
    client.set_parameters(replan_gain=0.01)
    client.wait_for(lambda: client.paths[shown:], "the shorter path")


def test_a_path_that_costs_less_replaces_a_shorter_one(drive):
    drive = drive(DETOUR, replan_rate=10.0)
    client = drive.client
    short = float(drive.go(GOAL, samples="300")["path_length"])
    drive.all_is_said()
    shown = len(client.paths)
    client.set_parameters(preferred_clearance=1.0, clearance_weight=5.0)
    client.wait_for(lambda: client.paths[shown:], "the path with more room")
    wide = poses_of(client.paths[-1])
    assert sum(math.dist(a[:2], b[:2]) for a, b in pairwise(wide)) > short


def test_only_the_part_of_the_path_ahead_of_the_vehicle_counts(drive):
    drive = drive(replan_on_map_change=True)
    client, process = drive.client, drive.process
    plan_id = drive.go(GOAL, samples="300")["plan_id"]
    for x in np.arange(2.0, 6.0, 0.5).tolist():
        drive.start((x, 5.0, 0.0))
    shown = len(client.paths)
    drive.show(BEHIND)
    client.wait_for_word("The map changed; the published path is free on it too")
    drive.all_is_said()
    assert len(client.paths) == shown
    assert {name for _, name, _ in drive.events(plan_id)} == {"NONE"}
    assert "not free" not in process.output


def test_a_broken_path_is_told_at_once_with_the_place_and_replaced_as_soon_as_an_audited_one_is_found(drive):
    drive = drive(replan_on_map_change=True)
    client = drive.client
    plan_id = int(drive.go(GOAL, samples="300")["plan_id"])
    shown = len(client.paths)
    drive.show(DETOUR)
    told = client.status_of(plan_id, error_name="NO_VALID_PATH")
    assert told["level"] == DiagnosticStatus.WARN
    assert "(4." in told["message"] or "(5." in told["message"], told["message"]
    wait_for_path_around(client, DETOUR)
    assert all(path.poses for path in client.paths[shown:])


def test_a_broken_path_is_withdrawn_after_planning_time_if_no_other_is_found_and_comes_back_when_a_map_allows_it(drive):
    drive = drive(replan_on_map_change=True, planning_time=0.5)
    client = drive.client
    plan_id = int(drive.go(FOURTH_GOAL, error_name="NONE")["plan_id"])
    client.status_of(plan_id, samples="300")
    drive.show(NARROW)
    client.status_of(plan_id, error_name="NO_VALID_PATH")
    assert client.status_of(plan_id + 1)["level"] == DiagnosticStatus.ERROR
    client.wait_for(lambda: drive.ends[-1] is None, "the empty path")
    drive.show(FREE)
    client.status_of(plan_id + 1, error_name="NONE")
    client.wait_for(lambda: drive.ends[-1] == FOURTH_GOAL[:2], "the path")


def test_one_wrong_cell_beside_the_vehicle_that_is_gone_in_the_next_map_leaves_the_goal_pursued(drive):
    drive = drive(replan_on_map_change=True, start=(1.0, 4.0, 0.0))
    client = drive.client
    plan_id = int(drive.go((8.0, 4.0, 0.0), samples="300")["plan_id"])
    drive.show(walled(np.s_[41, 10]))
    client.status_of(plan_id + 1, error_name="START_OCCUPIED")
    drive.show(FREE)
    client.status_of(plan_id + 1, error_name="NONE")
    client.wait_for(lambda: drive.ends[-1] == (8.0, 4.0), "the path")


def test_a_vehicle_that_has_left_its_path_gets_another_one(drive):
    drive = drive(replan_rate=10.0)
    drive.go(GOAL, samples="300")
    drive.start(elsewhere := (2.0, 8.0, 0.0))
    drive.client.wait_for(lambda: tuple(poses_of(drive.client.paths[-1])[0]) == elsewhere, "a path from there")


def test_a_goal_is_planned_at_least_once_and_reaching_it_ends_the_replanning_only(drive):
    drive = drive(replan_on_map_change=True, replan_rate=10.0, start=(GOAL[0] - 0.1, GOAL[1], GOAL[2] + 0.1))
    client = drive.client
    plan_id = int(drive.go(GOAL, samples="300")["plan_id"])
    shown = len(client.paths)
    drive.show(GAP)
    drive.start((2.0, 8.0, 0.0))
    time.sleep(0.5)
    drive.all_is_said()
    assert len(client.paths) == shown
    assert drive.go(GOAL, error_name="NONE")["plan_id"] == str(plan_id + 2)  # one was get_plan's
    client.wait_for(lambda: client.paths[shown:], "its path")


def test_a_vehicle_at_the_goal_before_has_not_reached_the_one_that_is_being_planned(drive):
    drive = drive(DETOUR, start=GOAL, replan_on_map_change=True, publish="final")
    client = drive.client
    drive.go(GOAL, error_name="NONE")
    client.set_parameters(samples=10_000_000, planning_time=1.0)
    plan_id = client.begin_goal(START)
    drive.start(GOAL)
    client.status_of(plan_id, error_name="NONE")
    drive.show(CLOSED)
    assert "not free" in client.status_of(plan_id, error_name="NO_VALID_PATH")["message"]


def test_publish_final_publishes_one_path_for_each_request_and_improvements_each_better_one(drive):
    drive = drive(DETOUR, samples=3000, publish="final")
    client = drive.client
    plan_id = drive.go(GOAL)["plan_id"]
    drive.all_is_said()
    assert len(client.paths) == len(drive.events(plan_id)) == 1
    client.set_parameters(publish="improvements")
    told = drive.go(OTHER_GOAL, samples="3000")
    client.wait_for(lambda: len(client.paths) == 1 + int(told["revision"]), "all of them")
    assert int(told["revision"]) > 1


#: Goals in a second, and for how many of them [s].
RATE, SECONDS = 1000, 10
#: Goals after which the client hears what has come even where it is late, as on a busy machine.
HEARING = 20


@pytest.mark.slow
@pytest.mark.parametrize("goals", [(OTHER_GOAL, THIRD_GOAL, FOURTH_GOAL), (OTHER_GOAL,)], ids=["different", "equal"])
def test_a_thousand_goals_a_second_have_a_path_at_least_every_planning_time_and_the_last_one_s_at_the_end(
        drive, goals, record_property):
    drive = drive(DETOUR, **QUICK | {"samples": 3000, "planning_time": 1.0})
    client = drive.client
    begin, heard = time.monotonic(), []
    for count in range(RATE * SECONDS):
        client.send("goal_pose", goals[count % len(goals)])
        if count % HEARING == 0:
            client.spin_once()
        while time.monotonic() < begin + count / RATE:
            client.spin_once()
        heard += [time.monotonic()] * (len(client.paths) - len(heard))
    client.send("goal_pose", GOAL)
    client.wait_for(lambda: drive.ends[-1:] == [GOAL[:2]], "the last one's path")
    gaps = np.diff([begin, *heard, time.monotonic()])
    record_property("paths", len(heard))
    record_property("longest time between two of them [s]", float(gaps.max()))
    assert len(heard) >= SECONDS
    assert None not in drive.ends
