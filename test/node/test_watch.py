"""`dubins_rrt watch`: the page over a running node, by its socket and in a browser."""

import math
import time

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("aiohttp", reason="aiohttp comes with the extra play")
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PoseArray
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import OccupancyGrid
from support.browser import open_browser
from support.play import serving_sessions, talk

from dubins_rrt_ros.cli.watch.listener import Listener
from dubins_rrt_ros.cli.watch.session import WatchSession
from dubins_rrt_ros.node.qos import LATCHED

START, GOAL, BLOCKED = [1.5, 5.0, 0.0], [8.5, 5.0, 0.5], [5.0, 5.0, 0.0]
QUICK = {"planner": "rrt_star", "samples": 300, "planning_time": 15.0, "seed": 1}
PATIENCE = 60.0


@pytest.fixture
def watched(planners, map_yaml):
    """A planner, and the server of a page that watches it."""
    yield from watching(planners, map_yaml)


@pytest.fixture(scope="module")
def watched_by_all(module_planners, map_file):
    """The same for all tests that change nothing."""
    yield from watching(module_planners, map_file)


def watching(planners, map_file):
    process = planners.start(map_file=str(map_file), **QUICK)
    process.wait_until_ready()
    listener = Listener(process.name)
    try:
        until(lambda: {"map", "parameters"} <= listener.latest.keys() and is_heard(listener))
        with serving_sessions(lambda send: WatchSession(listener, send)) as server:
            yield process, listener, server
    finally:
        listener.close()


def until(condition):
    """Wait until a condition holds, and return its value."""
    end = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.02)
    return value


def is_heard(listener):
    """Whether the planner listens to the poses, as the listener itself does."""
    return all(listener._publishers[topic].get_subscription_count() > 1 for topic in ("start_pose", "goal_pose"))


async def answer_with(page, wanted):
    """The first answer of which a condition holds."""
    while not wanted(answer := await page.receive("answer")):
        pass
    return answer


def ends_at(answer, goal):
    poses = np.array(answer["path"]).reshape(-1, 3)
    return len(poses) > 0 and math.dist(poses[-1, :2], goal[:2]) < 1e-3


def test_a_start_and_a_goal_are_sent_and_path_tree_and_status_shown(watched):
    async def ask(page):
        shown = await page.receive("map")
        await page.send(type="pose", name="start", pose=START)
        await page.send(type="pose", name="goal", pose=GOAL)
        answer = await answer_with(page, lambda answer: ends_at(answer, GOAL) and answer["status"] == "NONE")
        return shown, answer, await page.receive("tree")
    shown, answer, tree = talk(watched[2], ask)
    assert shown["high"] == [10.0, 10.0] and "Path of" in answer["message"]
    assert 7.0 < answer["lower_bound"] <= answer["length"] < 10 and len(tree) > 100


def test_a_page_that_comes_later_sees_what_there_is(watched):
    async def ask(page):
        await page.send(type="pose", name="start", pose=START)
        await page.send(type="pose", name="goal", pose=GOAL)
        await answer_with(page, lambda answer: ends_at(answer, GOAL))

    async def look(page):
        return [(await page.receive(kind))["type"] for kind in ("hello", "map", "parameters", "answer")]
    talk(watched[2], ask)
    assert talk(watched[2], look) == ["hello", "map", "parameters", "answer"]
    until(lambda: not watched[1].pages)
    assert watched[0].running, "closing a page disturbs nothing"


def test_where_there_is_no_path_the_reason_is_shown(watched):
    async def ask(page):
        await page.send(type="pose", name="start", pose=START)
        await page.send(type="pose", name="goal", pose=BLOCKED)
        return await answer_with(page, lambda answer: answer["status"] == "GOAL_OCCUPIED")
    answer = talk(watched[2], ask)
    assert answer["path"] == [] and answer["length"] is None
    assert "obstacle" in answer["message"], "also when it says by now that a map is waited for"


def test_a_map_that_cannot_be_shown_is_logged_and_passed_over(watched, capfd):
    listener = watched[1]
    publisher = listener._node.create_publisher(OccupancyGrid, "map", LATCHED)
    shown = listener.latest["map"]
    publisher.publish(OccupancyGrid())
    until(lambda: "A message cannot be shown" in capfd.readouterr().err)
    grid = OccupancyGrid(data=[0] * 6)
    grid.header.frame_id, grid.info.width, grid.info.height, grid.info.resolution = "map", 3, 2, 1.0
    grid.info.origin.orientation.w = 1.0
    publisher.publish(grid)
    assert until(lambda: listener.latest["map"] is not shown and listener.latest["map"])["high"] == [3.0, 2.0]


def test_parameters_are_shown_and_set_and_a_refusal_is_told(watched):
    async def ask(page):
        before = (await page.receive("parameters"))["values"]
        await page.send(type="set", name="turning_radius", value=2)
        while (after := (await page.receive("parameters"))["values"])["turning_radius"] == before["turning_radius"]:
            pass
        await page.send(type="set", name="turning_radius", value=-1)
        return before, after, (await page.receive("refused"))["message"]
    before, after, refusal = talk(watched[2], ask)
    assert (before["turning_radius"], after["turning_radius"], before["planner"]) == (1.0, 2.0, "rrt_star")
    assert "turning_radius" in refusal


@pytest.mark.parametrize("document, words", [
    ({"type": "pose", "name": "start", "pose": [1, 2]}, "start pose"),
    ({"type": "pose", "name": "end", "pose": START}, "no pose"),
    ({"type": "load", "name": "x"}, "load"), ({"type": "pose"}, "name")])
def test_what_cannot_be_done_is_refused_in_a_sentence(watched_by_all, document, words):
    async def ask(page):
        await page.send(**document)
        return (await page.receive("refused"))["message"]
    assert words in talk(watched_by_all[2], ask)


@pytest.mark.slow
def test_waypoints_of_another_node_are_shown_until_a_goal_without_comes(watched):
    listener = watched[1]

    async def follow(page):
        via = []
        listener.send_waypoints([(1.0, 2.0)], GOAL)
        while not via:
            via = (await page.receive("poses"))["via"]
        shown = via
        await page.send(type="pose", name="goal", pose=GOAL)
        while via:
            via = (await page.receive("poses"))["via"]
        return shown
    until(lambda: listener._publishers["goal_poses"].get_subscription_count() > 1)
    assert talk(watched[2], follow) == [[1.0, 2.0]]


def test_waypoints_that_are_none_are_not_shown_and_a_page_gets_nothing_but_json(watched_by_all):
    """NaN is no JSON: a browser would have shown nothing of it, and every later page neither."""
    listener = watched_by_all[1]
    shown = dict(listener._ends), list(listener._waypoints)
    for x in (math.nan, math.inf):
        listener._take_goals(PoseArray(poses=[PoseMessage(position=Point(x=x)), PoseMessage()]))
    assert (listener._ends, listener._waypoints) == shown
    sent = []
    session = WatchSession(listener, sent.append)
    session.show({"type": "answer", "length": math.inf, "path": [math.nan, 1.0]})
    session.take("[]")
    listener.pages.discard(session.show)
    assert sent[-2] == '{"type": "answer", "length": null, "path": [null, 1.0]}' and "it is no object" in sent[-1]


@pytest.mark.slow
def test_in_a_browser_a_drag_sends_the_goal_and_the_path_appears(watched):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait
    browser = open_browser()
    try:
        browser.get(watched[2].url)
        wait = WebDriverWait(browser, PATIENCE)
        wait.until(lambda _: browser.execute_script("return window.dubins?.view.map !== null"))
        assert not browser.find_element(By.CSS_SELECTOR, "[data-tool=draw]").is_displayed()
        assert browser.find_element(By.ID, "cancel").is_displayed()
        low, high, start, goal, unsent = browser.execute_script(
            "const v = window.dubins.view; return [v.map.low, v.map.high, v.start, v.goal, [...v.unsent]]")
        assert unsent == ["start", "goal"] and start != goal, "to be taken hold of, before any is sent"
        assert all(low[axis] < pose[axis] < high[axis] for pose in (start, goal) for axis in (0, 1))
        watched[1]._take_status(DiagnosticStatus(message="Ready for a goal.", values=[KeyValue(key="error_name", value="NONE")]))
        wait.until(lambda _: browser.find_element(By.ID, "title").text == "No path yet")
        drag = """
            const v = window.dubins.view, c = v.canvas, b = c.getBoundingClientRect();
            const fire = (kind, x, y) => { const [a, d] = v.toScreen(x, y); c.dispatchEvent(new PointerEvent(kind,
                { pointerId: 1, clientX: b.x + a, clientY: b.y + d, button: 0, bubbles: true })); };
            c.setPointerCapture = () => {};
            v.start = [2, 5, 0];
            fire("pointerdown", 2, 5); fire("pointermove", 1.5, 5); fire("pointerup", 1.5, 5);
            fire("pointerdown", 8.0, 5.0); fire("pointermove", 8.8, 5.0); fire("pointerup", 8.8, 5.0);"""
        wait.until(lambda _: browser.execute_script("return window.dubins.view.start !== null"))
        browser.execute_script(drag)
        wait.until(lambda _: browser.execute_script(
            "const a = window.dubins.view.answer; return a && a.poses.length > 0 && Math.abs(a.poses.at(-1)[0] - 8.0) < 0.1"))
        wait.until(lambda _: browser.find_element(By.ID, "title").text.startswith("Path of"))
        assert browser.execute_script("return window.dubins.view.tree.length") > 50
        wait.until(lambda _: browser.execute_script("return window.dubins.view.unsent.size") == 0)
    finally:
        browser.quit()
