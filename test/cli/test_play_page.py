"""The page of `dubins_rrt play` in a browser, used as a person would: by mouse, touch and keys."""

import math
from itertools import pairwise

import pytest

pytest.importorskip("aiohttp", reason="aiohttp comes with the extra play")
from support.browser import open_browser
from support.cases import needs_compiled
from support.play import serving, workbench

pytestmark = [needs_compiled, pytest.mark.slow]
PATIENCE = 60  # [s]; nothing here takes as long, unless it never comes


@pytest.fixture(scope="module")
def browser():
    driver = open_browser()
    yield driver
    driver.quit()


@pytest.fixture
def page(browser, tmp_path):
    browser.set_window_size(1280, 800)
    with serving(workbench(tmp_path)) as server:
        browser.get_log("browser")
        person = Person(browser, server)
        person.open()
        yield person
        errors = [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        assert [error for error in errors if "WebSocket" not in error] == []  # which a test interrupts
        browser.get("about:blank")


class Person:
    """What a person does on the page, and sees."""

    def __init__(self, browser, server):
        self.browser, self.server = browser, server

    def open(self):
        self.browser.get(self.server.url)
        self.script("sessionStorage.clear()")
        self.browser.get(self.server.url)
        self.wait_for("at rest", lambda: self.answer() and self.answer()["final"] and not self.answer()["quick"])

    def script(self, text, *arguments):
        return self.browser.execute_script(text, *arguments)

    def find(self, selector):
        from selenium.webdriver.common.by import By
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def wait_for(self, what, condition):
        from selenium.webdriver.support.ui import WebDriverWait
        return WebDriverWait(self.browser, PATIENCE, poll_frequency=0.05).until(lambda _: condition(), what)

    def answer(self):
        """The answer that is shown, but for its poses, which are in `path()`."""
        return self.script("const a = window.dubins?.view.answer; return a && {...a, poses: 0, path: 0};")

    def path(self):
        return self.script("return window.dubins.view.answer.poses")

    def pose(self, name):
        return self.script("return window.dubins.view[arguments[0]]", name)

    def wait_for_path_to(self, goal, name="goal"):
        def is_there():
            answer, path = self.answer(), self.path()
            end = path and path[-1 if name == "goal" else 0]
            return end and answer["final"] and not answer["quick"] and math.dist(end[:2], goal[:2]) < 1e-3
        self.wait_for(f"a path to {goal}", is_there)

    def on_screen(self, x, y):
        """The place of a point of the map [m] in the window [pixel]."""
        return self.script("const v = window.dubins.view, r = v.canvas.getBoundingClientRect(), p = v.toScreen(arguments[0], "
                           "arguments[1]); return [Math.round(r.x + p[0]), Math.round(r.y + p[1])]", x, y)

    def tip(self, name):
        return self.script("const v = window.dubins.view, r = v.canvas.getBoundingClientRect(), p = v.tip(v[arguments[0]]); "
                           "return [Math.round(r.x + p[0]), Math.round(r.y + p[1])]", name)

    def drag(self, *places, kind="mouse", steps=8):
        """Press at the first place [pixel], move over the others, and let go."""
        from selenium.webdriver.common.actions.action_builder import ActionBuilder
        from selenium.webdriver.common.actions.pointer_input import PointerInput
        pointer = PointerInput(kind, kind)
        actions = ActionBuilder(self.browser, mouse=pointer, duration=20)
        actions.pointer_action.move_to_location(*places[0]).pointer_down()
        for (x0, y0), (x1, y1) in pairwise(places):
            for share in (step / steps for step in range(1, steps + 1)):
                actions.pointer_action.move_to_location(round(x0 + (x1 - x0) * share), round(y0 + (y1 - y0) * share))
        actions.pointer_action.pointer_up()
        actions.perform()

    def set(self, selector, value):
        """Choose a value of a slider or a list, as a person would by dragging it."""
        self.script("const e = document.querySelector(arguments[0]); e.value = arguments[1]; "
                    "e.dispatchEvent(new Event('input')); e.dispatchEvent(new Event('change'))", selector, value)

    def colour_at(self, x, y):
        """The colour of the canvas at a point of the map [m]."""
        return self.script("""
            const v = window.dubins.view, [x, y] = v.toScreen(arguments[0], arguments[1]), ratio = window.devicePixelRatio;
            v.draw(performance.now());
            return [...v.context.getImageData(Math.round(x * ratio), Math.round(y * ratio), 1, 1).data].slice(0, 3);""", x, y)


def is_like(colour, wanted, most=40):
    return all(abs(a - b) <= most for a, b in zip(colour, wanted, strict=True))


ORANGE, WHITE, WALL = (0xd5, 0x5e, 0x00), (255, 255, 255), (70, 70, 70)


def test_the_legend_covers_no_map_and_is_not_there_on_a_small_screen(page):
    for size in ((1280, 720), (900, 700)):
        page.browser.set_window_size(*size)
        assert page.find("#legend").is_displayed()
        canvas, legend = page.find("#canvas").rect, page.find("#legend").rect
        assert canvas["y"] + canvas["height"] <= legend["y"] + 1 < page.find("main").rect["height"]  # which are rounded
    for size in ((640, 450), (1280, 520)):
        page.browser.set_window_size(*size)
        page.wait_for("a hidden legend", lambda: not page.find("#legend").is_displayed())


def test_it_opens_with_a_path_in_the_picture(page):
    assert page.find("#title").text.startswith("Path of ") and "no path is shorter than" in page.find("#figures").text
    path = page.path()
    assert is_like(page.colour_at(*path[len(path) // 2][:2]), ORANGE)
    assert is_like(page.colour_at(7.5, 11.0), WHITE) and is_like(page.colour_at(3.12, 3.0), WALL)
    assert page.script("return window.dubins.view.tree.length") > 100


@pytest.mark.parametrize("way", [1, -1], ids=["up", "down"])
def test_the_name_of_the_goal_does_not_cover_the_path_to_it(way, page):
    page.drag(page.on_screen(*page.pose("goal")[:2]), page.on_screen(13.5, 9.0))  # where there is room to turn round
    x, y, _ = page.pose("goal")
    page.drag(page.tip("goal"), page.on_screen(x, y + way))

    def last_path():
        answer, path = page.answer(), page.path()
        return path and answer["final"] and not answer["quick"] and way * math.sin(path[-1][2]) > 0.99 and path

    path = page.wait_for("a path in this heading", last_path)
    apart = 20 / page.script("return window.dubins.view.scale")  # where the name would be [m]
    place = next(pose[:2] for pose in reversed(path) if math.dist(pose[:2], (x, y)) > apart)
    assert is_like(page.colour_at(*place), ORANGE)


def test_the_path_follows_the_goal_while_it_is_dragged(page):
    before = page.script("return window.dubins.pictures")
    page.drag(page.on_screen(*page.pose("goal")[:2]), page.on_screen(12.8, 9.0), page.on_screen(10.5, 9.0), steps=25)
    assert page.script("return window.dubins.pictures") > before, "answers while the mouse drags are drawn"
    assert math.dist(page.pose("goal")[:2], (10.5, 9.0)) < 0.1
    page.wait_for_path_to(page.pose("goal"))


def test_the_heading_is_turned_by_the_tip_of_the_arrow(page):
    goal = page.pose("goal")
    page.drag(page.tip("goal"), page.on_screen(goal[0] - 1.2, goal[1]))
    assert abs(abs(page.pose("goal")[2]) - math.pi) < 0.1 and page.pose("goal")[:2] == goal[:2]
    page.wait_for_path_to(goal)


def test_a_drag_on_free_ground_sets_the_goal_and_its_heading(page):
    page.drag(page.on_screen(7.5, 10.5), page.on_screen(8.5, 10.5))
    x, y, theta = page.pose("goal")
    assert math.dist((x, y), (7.5, 10.5)) < 0.05 and abs(theta) < 0.05


def test_touch_drags_as_the_mouse_does(page):
    page.drag(page.on_screen(*page.pose("start")[:2]), page.on_screen(1.5, 5.0), kind="touch")
    assert math.dist(page.pose("start")[:2], (1.5, 5.0)) < 0.1
    page.wait_for_path_to(page.pose("start"), "start")


def test_keys_choose_move_and_turn(page):
    from selenium.webdriver.common.keys import Keys
    canvas = page.find("#canvas")
    goal = page.pose("goal")
    canvas.send_keys("g", Keys.ARROW_DOWN, Keys.ARROW_LEFT, "q")
    moved = page.pose("goal")
    assert moved[0] < goal[0] and moved[1] < goal[1] and moved[2] > goal[2]
    start = page.pose("start")
    canvas.send_keys("s", Keys.ARROW_UP)
    assert page.pose("start")[1] > start[1] and page.pose("goal") == moved
    page.wait_for_path_to(moved)


def test_a_wall_is_drawn_with_the_mouse_and_erased(page):
    before = page.answer()["length"]
    page.find("[data-tool=draw]").click()
    page.drag(page.on_screen(3.2, 6.0), page.on_screen(3.2, 7.8), page.on_screen(5.0, 7.8))
    page.wait_for("a longer path", lambda: page.answer()["final"] and (page.answer()["length"] or 0) > before + 0.2)
    assert is_like(page.colour_at(4.5, 7.8), WALL)
    page.find("[data-tool=erase]").click()
    page.set("#brush", 1)
    page.drag(page.on_screen(3.2, 7.2), page.on_screen(3.2, 7.8), page.on_screen(5.2, 7.8))
    page.wait_for("a short path", lambda: page.answer()["final"] and (page.answer()["length"] or 99) < before + 0.1)


def test_waypoints_are_set_dragged_and_removed(page):
    before = page.answer()["length"]
    page.set("#planning_time", 30)  # as a waypoint in any heading takes more, on a busy machine
    page.find("[data-tool=via]").click()
    place = page.on_screen(13.5, 2.0)
    page.drag(place, place)
    page.wait_for("a path over the waypoint", lambda: page.answer()["final"] and (page.answer()["length"] or 0) > before + 3)
    assert min(math.dist(pose[:2], (13.5, 2.0)) for pose in page.path()) < 0.1
    page.drag(place, page.on_screen(13.0, 2.5))
    page.wait_for("a path over it there", lambda: page.answer()["final"] and not page.answer()["quick"] and page.path()
                  and min(math.dist(pose[:2], (13.0, 2.5)) for pose in page.path()) < 0.1)
    page.drag(page.on_screen(13.0, 2.5), page.on_screen(13.0, 2.5))
    page.wait_for("the path without", lambda: page.answer()["final"] and (page.answer()["length"] or 99) < before + 0.1)


def test_the_vehicle_is_changed_by_sliders(page):
    before = page.answer()["length"]
    page.set("#turning_radius", 1.5)
    page.wait_for("a path for the new radius", lambda: page.answer()["final"] and page.answer()["length"] not in (None, before))
    page.set("#shape", "car")
    page.wait_for("a path for a car", lambda: page.answer()["final"] and len(page.answer()["footprint"]) == 4)
    assert page.find("#ahead").is_displayed() and not page.find("#robot_radius").is_displayed()


def test_where_there_is_no_path_it_says_why_and_marks_the_place(page):
    page.drag(page.on_screen(*page.pose("goal")[:2]), page.on_screen(3.1, 3.0))
    page.wait_for("the reason", lambda: page.answer()["final"] and page.answer()["status"] == "GOAL_OCCUPIED")
    assert "GOAL_OCCUPIED" in page.find("#title").text and "obstacle" in page.find("#message").text
    assert len(page.answer()["location"]) == 2


def test_the_window_is_made_smaller_and_reloaded(page):
    goal = page.pose("goal")
    page.drag(page.on_screen(*goal[:2]), page.on_screen(13.0, 9.5))
    goal = page.pose("goal")
    for width, height in ((900, 600), (420, 800)):
        page.browser.set_window_size(width, height)
        page.wait_for("a picture that fits", lambda: page.script("""
            const v = window.dubins.view, c = v.canvas, [x, y] = v.toScreen(15, 12), [a, b] = v.toScreen(0, 0);
            return a >= 0 && x <= c.clientWidth && y >= 0 && b <= c.clientHeight && x - a > 0.5 * Math.min(c.clientWidth,
                c.clientHeight) && document.documentElement.scrollWidth <= innerWidth"""))
    page.browser.refresh()
    page.wait_for("the page again", lambda: page.answer() and page.answer()["final"])
    assert page.pose("goal") == goal


def test_after_a_lost_connection_it_goes_on(page, tmp_path):
    with serving(workbench(tmp_path), token="t") as first:
        page.browser.get(first.url)
        page.wait_for("a path", lambda: page.answer() and page.answer()["final"])
        assert not page.find("#lost").is_displayed()
    page.wait_for("word of it", lambda: page.find("#lost").is_displayed())
    with serving(workbench(tmp_path), first.port, "t"):
        page.wait_for("the connection", lambda: not page.find("#lost").is_displayed())
        page.drag(page.on_screen(*page.pose("goal")[:2]), page.on_screen(13.0, 9.0))
        page.wait_for_path_to(page.pose("goal"))


def test_a_map_is_chosen_and_the_request_copied(page):
    page.set("#files", "forest.geojson")
    page.wait_for("the forest", lambda: page.script("return window.dubins.view.map.name") == "forest.geojson")
    page.wait_for("its path", lambda: page.answer() and page.answer()["final"] and page.answer()["length"] > 20)
    page.script("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    page.find("[data-copy=command]").click()
    page.wait_for("the text", lambda: page.find("#copied").get_attribute("value").startswith("dubins_rrt plan forest.geojson"))


def test_the_car_drives_along_the_path(page):
    page.find("#drive").click()
    assert page.script("return window.dubins.view.driver !== null")


def test_all_that_is_loaded_is_from_this_server(page):
    loaded = page.script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert len(loaded) >= 3 and all(name.startswith((f"http://127.0.0.1:{page.server.port}/", "data:")) for name in loaded)


def test_text_stands_out_from_its_background(page):
    """At least 4.5 : 1, as WCAG 2 asks for."""
    worst = page.script("""
        const light = (c) => { const [r, g, b] = c.match(/[0-9.]+/g).slice(0, 3).map((v) => { v /= 255;
            return v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; }); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
        const ground = (e) => { for (; e; e = e.parentElement) { const c = getComputedStyle(e).backgroundColor;
            if (!/, 0\\)$/.test(c)) { return c; } } return "rgb(255,255,255)"; };
        document.querySelectorAll('details').forEach((d) => { d.open = true; });
        const shown = [...document.querySelectorAll("aside *, #legend")].filter((e) => e.innerText && e.offsetParent);
        return Math.min(...shown.map((e) => {
            const [a, b] = [light(getComputedStyle(e).color), light(ground(e))].sort((x, y) => y - x);
            return (a + 0.05) / (b + 0.05); }));""")
    assert worst >= 4.5
