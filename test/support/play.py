"""The server of `dubins_rrt play` in a thread, and a client of its socket."""

import asyncio
import contextlib
import json
import threading

import aiohttp

from dubins_rrt_ros.cli.play.server import PlayServer
from dubins_rrt_ros.cli.play.session import Session
from dubins_rrt_ros.cli.play.workbench import Workbench
from dubins_rrt_ros.planning import load_map

START, GOAL = [1.5, 2.0, 1.57], [13.5, 10.5, 1.57]
TIMEOUT = 60.0


def workbench(folder, name="maze"):
    return Workbench(load_map(name), name, str(folder))


@contextlib.contextmanager
def serving(bench, port=0, token=""):
    """Serve a workbench in a thread while the context lasts; the context is the server."""
    with serving_sessions(lambda send: Session(bench, send), port, token) as server:
        yield server


@contextlib.contextmanager
def serving_sessions(make_session, port=0, token=""):
    """Serve pages in a thread while the context lasts; the context is the server."""
    loop, server = asyncio.new_event_loop(), PlayServer(make_session, token)
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        asyncio.run_coroutine_threadsafe(server.start(port), loop).result(TIMEOUT)
        yield server
    finally:
        asyncio.run_coroutine_threadsafe(server.stop(), loop).result(TIMEOUT)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(TIMEOUT)
        loop.close()


def get(server, path, **headers):
    """Status and text of an address of a server."""
    async def ask():
        async with aiohttp.ClientSession() as session, session.get(
                f"http://127.0.0.1:{server.port}{path}", headers=headers) as response:
            return response.status, await response.text(), response.headers
    return asyncio.run(ask())


class Page:
    """What a page sends and receives."""

    def __init__(self, socket):
        self.socket = socket

    async def send(self, **document):
        await self.socket.send_str(json.dumps(document))

    async def plan(self, number, **document):
        await self.send(type="plan", id=number, **({"start": START, "goal": GOAL} | document))

    async def receive(self, kind):
        """The next message of a type; others are dropped."""
        while True:
            message = await self.socket.receive(TIMEOUT)
            assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY), message
            if message.type == aiohttp.WSMsgType.BINARY:
                if kind == "tree":
                    return message.data
            elif (document := json.loads(message.data))["type"] == kind:
                return document

    async def final(self, number):
        """The last answer to a request, and the numbers of all that were answered on the way."""
        seen = []
        while True:
            answer = await self.receive("answer")
            seen.append(answer["id"])
            if answer["final"] and answer["id"] == number:
                return answer, seen


def talk(server, conversation, origin=None, token=None):
    """Open the socket as the page does, and return what the conversation with the Page returns."""
    async def run():
        address = f"http://127.0.0.1:{server.port}"
        async with aiohttp.ClientSession() as session, session.ws_connect(
                f"{address}/socket?token={server.token if token is None else token}",
                headers={"Origin": address if origin is None else origin}, max_msg_size=0) as socket:
            return await conversation(Page(socket))
    return asyncio.run(run())
