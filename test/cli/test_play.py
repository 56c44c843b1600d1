"""`dubins_rrt play`: what the server answers, and that it answers nobody else."""

import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys

import numpy as np
import pytest

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.cli.play.workbench import Workbench
from dubins_rrt_ros.planning import GridMap, MapError, PolygonMap, load_map, save_map

aiohttp = pytest.importorskip("aiohttp", reason="aiohttp comes with the extra play")
from support.play import GOAL, START, get, serving, talk, workbench  # noqa: E402 - it imports aiohttp

QUICK = {"quick": True, "settings": {"seed": 1}}
FULL = {"quick": False, "settings": {"seed": 1, "samples": 200, "planning_time": 30.0}}


@pytest.fixture
def bench(tmp_path):
    return workbench(tmp_path)


@pytest.fixture
def server(bench):
    with serving(bench) as running:
        yield running


# Only our own page on this machine is served.

def test_the_page_needs_its_token(server):
    assert get(server, f"/?token={server.token}")[0] == 200
    for path in ("/", "/?token=", f"/?token={server.token}x", "/?token=%C3%A9"):
        assert get(server, path)[0] == 403, path


def test_another_name_of_this_machine_is_refused(server):
    """A site whose name leads to 127.0.0.1 would otherwise be of the same origin as our page."""
    path = f"/?token={server.token}"
    assert get(server, path, Host=f"localhost:{server.port}")[0] == 200
    for host in (f"evil.example:{server.port}", "127.0.0.1", "localhost:1", f"127.0.0.1.evil.example:{server.port}"):
        assert get(server, path, Host=host)[0] == 403, host


def test_a_browser_leaves_the_port_80_out(server, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.cli.play.server.HTTP_PORT", server.port)
    path = f"/?token={server.token}"
    assert [get(server, path, Host=host)[0] for host in ("127.0.0.1", "localhost", "evil.example")] == [200, 200, 403]


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:1"])
def test_a_page_of_another_origin_opens_no_socket(server, origin):
    with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        talk(server, lambda page: page.receive("hello"), origin=origin)
    assert refused.value.status == 403


def test_a_socket_without_the_token_is_refused(server):
    with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        talk(server, lambda page: page.receive("hello"), token="guessed")
    assert refused.value.status == 403


def test_it_listens_on_this_machine_alone(server):
    host = server._runner.addresses[0][0]
    assert host == "127.0.0.1"


def test_the_page_loads_nothing_from_elsewhere(server):
    _, text, headers = get(server, f"/?token={server.token}")
    assert "default-src 'none'" in headers["Content-Security-Policy"] and headers["Referrer-Policy"] == "no-referrer"
    for name in ("/page.css", "/page.js", "/canvas.js"):
        assert name in text + get(server, "/page.js")[1]
        assert not re.search(r"https?://", get(server, name)[1])
    assert not re.search(r"https?://", text) and get(server, "/../server.py")[0] == 404


def test_too_long_a_message_closes_the_socket_and_nothing_else(server):
    async def flood(page):
        await page.receive("map")
        await page.socket.send_str("x" * (2 << 20))
        while (message := await page.socket.receive(30)).type not in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED):
            pass
        return message.data
    assert talk(server, flood) == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
    assert talk(server, lambda page: page.receive("hello"))["files"]


# Maps stay in the folder.

@pytest.mark.parametrize("name", ["../other.yaml", "/etc/passwd", "link.yaml", "links/other.yaml", "", "a\0b.yaml", "~/x.yaml"])
def test_maps_are_loaded_and_saved_below_the_folder_alone(tmp_path, name):
    folder, outside = tmp_path / "maps", tmp_path / "other.yaml"
    folder.mkdir()
    save_map(GridMap(np.zeros((30, 30), np.int8), 0.1), outside)
    (folder / "link.yaml").symlink_to(outside)
    (folder / "links").symlink_to(tmp_path)
    bench, before = workbench(folder), outside.read_bytes()
    shown = bench.map
    for act in (bench.load, bench.save):
        with pytest.raises(MapError):
            act(name)
    assert bench.map is shown and outside.read_bytes() == before and not (folder / "~").exists()


def test_an_image_outside_of_the_folder_is_not_read(tmp_path):
    folder = tmp_path / "maps"
    folder.mkdir()
    save_map(GridMap(np.zeros((30, 30), np.int8), 0.1), tmp_path / "secret.yaml")
    (folder / "thief.yaml").write_text((tmp_path / "secret.yaml").read_text().replace("secret.pgm", "../secret.pgm"))
    with pytest.raises(MapError, match="outside"):
        workbench(folder).load("thief.yaml")


def test_an_image_that_is_a_link_to_elsewhere_is_not_written(tmp_path, bench):
    outside = tmp_path.parent / f"{tmp_path.name}-outside.pgm"
    outside.write_bytes(b"mine")
    (tmp_path / "new.pgm").symlink_to(outside)
    with pytest.raises(MapError):
        bench.save("new.yaml")
    assert outside.read_bytes() == b"mine"


def test_too_large_a_file_is_refused_unread(tmp_path, bench):
    with (tmp_path / "huge.geojson").open("wb") as file:
        file.truncate((64 << 20) + 1)
    with pytest.raises(MapError, match="64 MB"):
        bench.load("huge.geojson")


# What it answers.

def test_not_all_folders_are_looked_through(tmp_path, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.cli.play.workbench.MOST_FOLDERS", 3)
    for name in "abcd":
        (tmp_path / name).mkdir()
        (tmp_path / name / "m.wkt").touch()
    assert [name for name in workbench(tmp_path).files() if "/" in name] == ["a/m.wkt", "b/m.wkt"]


def test_a_page_is_greeted_with_options_files_and_map(server, tmp_path):
    async def greeted(page):
        return await page.receive("hello"), await page.receive("map")
    hello, shown = talk(server, greeted)
    assert {"maze.yaml", "forest.geojson"} <= set(hello["files"])
    assert {"turning_radius", "footprint"} <= {item["name"] for item in hello["options"]["vehicle"]}
    assert shown["picture"].startswith("data:image/png;base64,") and shown["new"]
    assert np.allclose([shown["start"], shown["goal"]], [START, GOAL], atol=0.01)


def test_while_the_mouse_drags_the_first_audited_path_is_the_answer(server):
    async def drag(page):
        await page.plan(1, **QUICK)
        answer, seen = await page.final(1)
        return answer, seen, await page.receive("tree")
    answer, seen, tree = talk(server, drag)
    assert (answer["status"], seen) == ("NONE", [1]) and answer["quick"] and answer["samples"] == 0
    poses = np.array(answer["path"]).reshape(-1, 3)
    assert np.allclose(poses[0], START, atol=1e-4) and np.allclose(poses[-1], GOAL, atol=1e-4)
    assert 0 < answer["lower_bound"] <= answer["length"] < 22 and answer["min_clearance"] >= 0.2
    numbers = np.frombuffer(tree, "<f4")
    assert numbers[0] == 1 and len(numbers) % 4 == 1 and len(numbers) > 40


def test_at_rest_it_goes_on_improving(server):
    async def rest(page):
        await page.plan(1, **FULL)
        return await page.final(1)
    answer, _ = talk(server, rest)
    assert answer["samples"] == 200 and answer["length"] <= answer["first_length"]


def test_of_the_requests_that_wait_only_the_newest_is_served(server):
    async def hurry(page):
        await page.plan(1, quick=False, settings={"samples": 10_000_000, "planning_time": 60.0})
        await page.receive("answer")
        for number in range(2, 30):
            await page.plan(number, **QUICK)
        return await page.final(29)
    answer, seen = talk(server, hurry)
    assert answer["status"] == "NONE" and len(set(seen)) < 15


def test_where_there_is_no_path_the_reason_and_its_place_are_told(server):
    async def blocked(page):
        await page.plan(1, goal=[3.1, 3.0, 0.0], **QUICK)
        return (await page.final(1))[0]
    answer = talk(server, blocked)
    assert answer["status"] == "GOAL_OCCUPIED" and answer["path"] == [] and len(answer["location"]) == 2


@pytest.mark.parametrize("text, words", [
    ("no JSON", "Expecting"), ("[]", "no object"), ('{"type": "format"}', "format"), ("[" * 100_000, "recursion"),
    ('{"type": "plan", "start": [0, 0]}', "start pose"),
    ('{"type": "plan", "start": [1, 2, 0], "goal": [1, 3, 0], "via": [[1]]}', "waypoint 1"),
    ('{"type": "plan", "start": [1, 2, 0], "goal": [1, 2, NaN]}', "goal pose"),
    ('{"type": "plan", "start": [1, 2, 0], "goal": [1, 3, 0], "vehicle": {"wings": 2}}', "wings"),
    ('{"type": "plan", "start": [1, 2, 0], "goal": [1, 3, 0], "settings": {"samples": -1}}', "samples"),
    ('{"type": "plan", "start": [1, 2, 0], "goal": [1, 3, 0], "vehicle": [2]}', "vehicle is [2]; give an object of options"),
    ('{"type": "plan", "start": [1, 2, 0], "goal": [1, 3, 0], "via": 5}', "the waypoints are 5"),
    ('{"type": "draw", "points": [], "radius": 1, "obstacle": true}', "has points and a radius"), ('{"type": "draw"}', "points"),
    ('{"type": "draw", "points": [[1, 1]], "radius": -1, "obstacle": true}', "has points and a radius"),
    ('{"type": "draw", "points": [[1, 1]], "radius": 1e999, "obstacle": true}', "has points and a radius"),
    ('{"type": "draw", "points": [[1e300, 1]], "radius": 1, "obstacle": true}', "has points and a radius"),
    ('{"type": "load", "name": "../maze.yaml"}', "'../maze.yaml' is outside of "),
    (f'{{"type": "draw", "points": [[1{"0" * 400}, 1]], "radius": 1, "obstacle": true}}', "too large"),
    (f'{{"type": "plan", "start": [1{"0" * 400}, 2, 0], "goal": [1, 3, 0]}}', "start pose"),
    ('{"type": "draw", "points": [[NaN, 1]], "radius": 1, "obstacle": true}', "has points and a radius"),
    ('{"type": "load", "name": "nowhere.yaml"}', "nowhere.yaml"), ('{"type": "copy"}', "no answer")])
def test_what_cannot_be_done_is_refused_in_a_sentence_and_the_next_is_served(server, text, words):
    async def bad(page):
        await page.receive("map")
        await page.socket.send_str(text)
        refused = await page.receive("refused")
        await page.plan(7, **QUICK)
        return refused["message"], (await page.final(7))[0]
    message, answer = talk(server, bad)
    assert words in message and "\n" not in message and answer["status"] == "NONE"


def test_a_wall_that_is_drawn_is_driven_around_and_one_erased_driven_through(server):
    async def walled(page):
        async def length(number):
            await page.plan(number, start=[1.0, 8.0, 0.0], goal=[5.0, 8.0, 0.0], **QUICK)
            return (await page.final(number))[0]["length"]
        free = await length(1)
        wall = {"points": [[3.2, 7.4], [3.2, 8.8]], "radius": 0.3}
        await page.send(type="draw", obstacle=True, done=True, **wall)
        shown, around = await page.receive("map"), await length(2)
        await page.send(type="draw", obstacle=False, done=True, **wall)
        return free, shown, around, await length(3)
    free, shown, around, again = talk(server, walled)
    assert not shown["new"] and around > free + 0.1 and again == pytest.approx(free)


@pytest.mark.parametrize("name, kind", [("mine.yaml", GridMap), ("mine.geojson", PolygonMap), ("mine.wkt", PolygonMap)])
def test_maps_are_drawn_on_saved_and_loaded_in_all_formats(tmp_path, name, kind):
    bench = workbench(tmp_path, "maze" if kind is GridMap else "maze.geojson")
    before = bench.map
    bench.draw([(2.0, 10.0), (3.0, 10.5)], 0.2, is_obstacle=True)
    assert bench.changed and bench.map.id != before.id
    bench.save(name)
    assert not bench.changed and name in bench.files()
    again = load_map(tmp_path / name)
    assert again.id == bench.map.id if kind is GridMap else again.free.equals(bench.map.free)
    bench.load("maze.yaml")
    bench.load(name)
    assert isinstance(bench.map, kind) and bench.name.endswith(name)
    with pytest.raises(MapError, match="let the name end"):
        bench.save("mine.txt")


def test_an_edited_map_plans_as_one_that_is_prepared_anew(tmp_path):
    from dubins_rrt_ros.planning import Problem, Settings, Vehicle, plan
    bench = workbench(tmp_path)
    bench.world(Vehicle(), False)
    bench.draw([(4.5, 6.0), (4.5, 8.0)], 0.3, is_obstacle=True)
    settings = Settings(seed=1, samples=100, planning_time=60.0)
    edited = plan(Problem(bench.world(Vehicle(), False), start=START, goal=GOAL), settings)
    assert edited.path == plan(Problem(bench.map, Vehicle(), START, GOAL), settings).path


@pytest.mark.parametrize("via", [[], pytest.param([[4.5, 5.0], [10.0, 7.5, 0.3]], marks=pytest.mark.slow)])
def test_what_is_copied_plans_the_same(server, via, capsys, monkeypatch, tmp_path):
    async def copied(page):
        await page.plan(1, via=via, vehicle={"turning_radius": 1.2}, problem={"any_goal_heading": True}, settings={
            "seed": 3, "samples": 50, "planning_time": 30.0, "shortcut": False})
        answer, texts = (await page.final(1))[0], {}
        for kind in ("command", "Python", "JSON"):
            await page.send(type="copy", **{"as": kind})
            texts[kind] = (await page.receive("copy"))["text"]
        return answer, texts
    answer, texts = talk(server, copied)
    assert json.loads(texts["JSON"])["length"] == answer["length"]
    monkeypatch.chdir(tmp_path)
    assert main([*shlex.split(texts["command"])[1:], "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["length"] == answer["length"]
    names = {}
    exec(texts["Python"], names)
    assert names["result"].length == answer["length"]


@pytest.mark.parametrize("loads", [False, True], ids=["begun with", "loaded on the page"])
def test_what_is_copied_says_how_a_picture_was_read(loads, tmp_path, capsys, monkeypatch):
    from PIL import Image
    Image.new("L", (40, 30), 255).save(tmp_path / "room.png")
    bench = workbench(tmp_path)
    if not loads:
        bench = Workbench(load_map(tmp_path / "room.png", resolution=0.5), "room.png", str(tmp_path), {"resolution": 0.5})

    async def copied(page):
        if loads:
            await page.send(type="load", name="room.png", resolution=0.5)
        await page.plan(1, start=[3, 10, 0], goal=[17, 10, 0], settings={"samples": 10, "planning_time": 30.0})
        await page.final(1)
        texts = []
        for kind in ("command", "Python"):
            await page.send(type="copy", **{"as": kind})
            texts.append((await page.receive("copy"))["text"])
        return texts
    with serving(bench) as server:
        command, program = talk(server, copied)
    monkeypatch.chdir(tmp_path)
    assert main(shlex.split(command)[1:]) == 0
    exec(program, names := {})
    assert names["result"].solved


def test_a_large_grid_is_shown_smaller_and_no_wall_vanishes():
    from dubins_rrt_ros.cli.play.messages import map_document
    data = np.zeros((3000, 5000), np.int8)
    data[:, 2501] = 100
    shown = map_document(GridMap(data, 0.05), "large", True)
    import base64
    import io

    from PIL import Image
    picture = np.array(Image.open(io.BytesIO(base64.b64decode(shown["picture"].split(",")[1]))))
    assert max(picture.shape) <= 2048 and (picture.min(axis=1) < 100).all()
    assert math.isclose(shown["size"][0], 250, rel_tol=0.01)


# The command.

@pytest.mark.slow
def test_the_command_prints_its_address_and_ends_by_ctrl_c(tmp_path):
    with subprocess.Popen([sys.executable, "-m", "dubins_rrt_ros", "play", "--no-browser"], cwd=tmp_path, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"PYTHONUNBUFFERED": "1"}) as process:
        try:
            address = process.stdout.readline()
            assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=\S{32}\n", address)
            process.send_signal(signal.SIGINT)
            assert process.wait(60) == 0 and process.stderr.read() == ""
        finally:
            process.kill()


@pytest.mark.parametrize("words, message", [
    (["--folder", "nowhere"], "there is no folder nowhere"), (["--port", "70000"], "--port is 70000"), (["mase"], "maze")])
def test_wrong_usage_is_told_in_a_line(words, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["play", "--no-browser", *words]) == 2
    assert message in capsys.readouterr().err


def test_a_port_in_use_is_told(server, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["play", "--no-browser", "--port", str(server.port)]) == 2
    assert f"port {server.port} of 127.0.0.1 cannot be used" in capsys.readouterr().err
