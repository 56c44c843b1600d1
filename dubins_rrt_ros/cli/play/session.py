"""One page: its requests are served one at a time, and of those that wait only the newest."""

import asyncio
import json
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from dubins_rrt_ros.planning import Plan, Problem, Progress, plan, plan_through
from dubins_rrt_ros.planning.plan_file import to_document

from ..common.output import finite
from . import messages
from .messages import PlanRequest
from .workbench import Workbench

#: Time limit of a request while the mouse drags [s], and time after which a newer one ends it, though it has no path yet [s].
QUICK_LIMIT, PATIENCE = 0.5, 0.1

Send = Callable[[str | bytes], None]


class Session:
    """The requests of one page.

    The newest wins: it waits until the request under way has its first path, or has had its time for that, and then ends it.
    """

    def __init__(self, workbench: Workbench, send: Send):
        """Start to serve.

        Args:
            workbench: the map.
            send: takes a message for the page, a text or bytes; may be called by any thread.
        """
        self._workbench, self._send = workbench, send
        self._jobs: deque[Callable[[], None]] = deque()
        self._newest: PlanRequest | None = None
        self._wake = asyncio.Event()
        self._closed = threading.Event()
        self._last: tuple[PlanRequest, Plan] | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="play")
        self._task = asyncio.create_task(self._serve())
        self._jobs.append(lambda: self._do(Session._greet, {}))
        self._wake.set()

    async def close(self) -> None:
        """End the request under way, and the thread."""
        self._closed.set()
        self._wake.set()
        try:
            await self._task
        finally:
            self._thread.shutdown(wait=False)

    def take(self, text: str) -> None:
        """Take a message of the page."""
        try:
            document = json.loads(text)
            if not isinstance(document, dict):
                raise ValueError("it is no object")
            self._take(document)
        except Exception as error:  # of any kind: the page goes on
            self._refuse(error)
        self._wake.set()

    def _take(self, document: dict[str, Any]) -> None:
        kind = document.get("type")
        if kind == "plan":
            self._newest = messages.read_request(document)
        elif kind in JOBS:
            self._jobs.append(lambda: self._do(JOBS[kind], document))
        else:
            raise ValueError(f"there is no message of the type {kind!r}")

    async def _serve(self) -> None:
        loop = asyncio.get_running_loop()
        while not self._closed.is_set():
            await self._wake.wait()
            self._wake.clear()
            while not self._closed.is_set() and (job := self._next_job()):
                await loop.run_in_executor(self._thread, self._try, job)

    def _next_job(self) -> Callable[[], None] | None:
        if self._jobs:
            return self._jobs.popleft()
        request, self._newest = self._newest, None
        return (lambda: self._plan(request)) if request else None

    def _try(self, job: Callable[[], None]) -> None:
        try:
            job()
        except Exception as error:  # of any kind: the page waits for an answer
            self._refuse(error)

    def _refuse(self, error: Exception) -> None:
        self._send_document({"type": "refused", "message": str(error) or type(error).__name__})

    def _send_document(self, document: Mapping[str, Any]) -> None:
        self._send(json.dumps(finite(dict(document)), allow_nan=False))

    def _do(self, job: Callable[["Session", Mapping[str, Any]], None], document: Mapping[str, Any]) -> None:
        with self._workbench.lock:
            job(self, document)

    def _greet(self, document: Mapping[str, Any]) -> None:
        self._send_document({"type": "hello", "options": messages.option_documents(), "files": self._workbench.files()})
        self._show_map(is_new=True)

    def _show_map(self, is_new: bool) -> None:
        bench = self._workbench
        self._send_document(messages.map_document(bench.map, bench.name, is_new))

    # What the page may ask for beside plans.

    def _load(self, document: Mapping[str, Any]) -> None:
        resolution = document.get("resolution")
        self._workbench.load(str(document.get("name", "")), float(resolution) if resolution else None)
        self._show_map(is_new=True)

    def _save(self, document: Mapping[str, Any]) -> None:
        self._workbench.save(str(document.get("name", "")))
        self._send_document({"type": "saved", "name": self._workbench.name, "files": self._workbench.files()})

    def _draw(self, document: Mapping[str, Any]) -> None:
        points = [(float(x), float(y)) for x, y in document["points"]]
        self._workbench.draw(points, float(document["radius"]), document["obstacle"] is True)
        if document.get("done") is True:
            self._show_map(is_new=False)

    def _copy(self, document: Mapping[str, Any]) -> None:
        if self._last is None:
            raise ValueError("there is no answer to copy yet")
        (request, answer), bench, kind = self._last, self._workbench, document.get("as")
        if kind == "JSON":
            text = json.dumps(finite(to_document(answer, bench.name)), allow_nan=False)
        else:
            text = (messages.as_python if kind == "Python" else messages.as_command)(request, bench.name, bench.options)
        note = "The map was drawn on: save it first, so that this finds it." if bench.changed else ""
        self._send_document({"type": "copy", "as": kind, "text": text, "note": note})

    def _plan(self, request: PlanRequest) -> None:
        """Plan, and send each better path on the way."""
        began, first = time.monotonic(), list[float | None]()

        def is_superseded() -> bool:
            waits = self._newest is not None or bool(self._jobs)
            return self._closed.is_set() or (waits and (bool(first) or time.monotonic() - began > PATIENCE))

        def show(progress: Progress) -> None:
            if progress.improved and not first:
                first.append(progress.length)
            if not request.is_quick:
                so_far = replace(progress.snapshot(), tree=progress.tree(), samples=progress.samples)
                self._show(request, so_far, False, *first[:1])

        with self._workbench.lock:
            world = self._workbench.world(request.vehicle, request.problem.get("allow_unknown", False))
        problem = Problem(world, start=request.start, goal=request.goal, **request.problem)
        settings = request.settings
        if request.is_quick:
            settings = replace(settings, planner="rrt", planning_time=min(QUICK_LIMIT, settings.planning_time))
        follow: dict[str, Any] = {"cancel": is_superseded, "on_progress": show}
        answer = plan_through(problem, request.via, settings, **follow) if request.via else plan(problem, settings, **follow)
        self._last = request, answer
        self._show(request, answer, True, *first[:1])

    def _show(self, request: PlanRequest, answer: Plan, is_final: bool, first_length: float | None = None) -> None:
        self._send_document(messages.answer_document(request, answer, is_final, first_length))
        self._send(messages.tree_bytes(request, answer))


#: What the page may ask for beside plans, by the types of its messages; done in order, and before a plan that waits.
JOBS: dict[Any, Callable[[Session, Mapping[str, Any]], None]] = {
    "load": Session._load, "save": Session._save, "draw": Session._draw, "copy": Session._copy}
