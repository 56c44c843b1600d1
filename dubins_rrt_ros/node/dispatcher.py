"""From a start and a goal to a request that a worker serves, and back to the executor with its outcome."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.task import Future

from dubins_rrt_ros.planning import Map, Plan, Pose, Problem

from .executor_queue import ExecutorQueue
from .maps import Maps
from .outcome import Outcome, outcome_of
from .parameters import Parameters
from .request import PlanRequest, RefusedRequest, Route
from .worker import Job, Worker

#: Called in the executor's thread with the outcome of a request.
OnEnd = Callable[[Outcome], None]
#: Called there with the best plan of a request so far.
OnImprovement = Callable[[Plan], None]
#: Time that each worker gets to act on its cancellation at shutdown [s].
SHUTDOWN_TIMEOUT = 0.2
#: Maximum time that a search waits until its better path is published [s]. It takes a millisecond, but several where the search
#: and its background have all cores.
PUBLISHING_TIMEOUT = 0.005


@dataclass(frozen=True, eq=False)
class Submission:
    """A request under way.

    Attributes:
        job: cancels it alone.
        outcome: to be awaited in the executor's thread; its result is the `Outcome`.
    """

    job: Job
    outcome: Future


class Dispatcher:
    """Makes requests from the newest map and the present parameters, and has workers serve them.

    Attributes:
        goals: the worker for goals by topic, of which the newest counts.
        services: the worker for services, which are all answered, in order; so neither waits for the other.
    """

    def __init__(self, node: Node, parameters: Parameters, maps: Maps, queue: ExecutorQueue):
        self._node, self._parameters, self._maps, self._queue = node, parameters, maps, queue
        self._workers: list[Worker] = []
        self.goals, self.services = self.new_worker("goals"), self.new_worker("services")
        self._newest_id = 0
        self._under_way: dict[Future, Submission] = {}

    @property
    def any_goal_heading(self) -> bool:
        """True if goals may be reached with any heading."""
        return bool(self._parameters.read().problem["any_goal_heading"])

    def new_worker(self, name: str) -> Worker:
        """Return one more worker, which neither waits for the others nor keeps them waiting."""
        self._workers.append(Worker(name))
        return self._workers[-1]

    def new_id(self) -> int:
        """Return the plan_id of a new request."""
        self._newest_id += 1
        return self._newest_id

    def request(self, world_map: Map, locate: Callable[[], Route], **options: Any) -> PlanRequest:
        """Make a request.

        Args:
            world_map: the newest map.
            locate: as in `PlanRequest`; called in the worker's thread.
            options: of `Problem`, where they differ from the parameters.
        """
        now = self._parameters.read()

        def problem(start: Pose, goal: Pose) -> Problem:
            return Problem(world_map, now.vehicle, start, goal, **{**now.problem, **options})

        return PlanRequest(locate, problem, now.settings, self._maps.world_for_request(), now.node.check_invariants)

    def submit(self, worker: Worker, request: PlanRequest | RefusedRequest, on_end: OnEnd,
               on_improvement: OnImprovement | None = None, finish: Callable[[Plan], None] | None = None) -> Submission:
        """Have a worker serve a request after what it was given before.

        Args:
            worker: `goals`, `services` or one of `new_worker`.
            request: what to plan.
            on_end: called once.
            on_improvement: called for the better paths meanwhile.
            finish: called in the worker's thread with the plan, before `on_end`: for what would keep the executor waiting.
        """
        outcome = Future()
        improved = None if on_improvement is None else partial(self._post_and_wait, on_improvement)
        job = worker.submit(partial(_serve, request, improved, finish), partial(self._post, self._end, outcome, on_end))
        self._under_way[outcome] = submission = Submission(job, outcome)
        return submission

    def _post(self, call: Callable[..., None], *arguments: object) -> None:
        self._queue.post(partial(call, *arguments))

    def _post_and_wait(self, call: Callable[[Plan], None], plan: Plan) -> None:
        made = threading.Event()

        def make() -> None:
            try:
                call(plan)
            finally:
                made.set()

        self._queue.post(make)
        made.wait(PUBLISHING_TIMEOUT)

    def _end(self, awaited: Future, on_end: OnEnd, result: Plan | Exception) -> None:
        outcome = self._maps.with_remark(outcome_of(result, self._node))
        del self._under_way[awaited]
        awaited.set_result(outcome)
        on_end(outcome)

    def cancel_all(self) -> list[Submission]:
        """Cancel all requests and return them; each still has an outcome."""
        for worker in self._workers:
            worker.cancel_all()
        return list(self._under_way.values())

    async def end_all(self) -> None:
        """Cancel all that the workers have to do, and wait until it has ended."""
        self.cancel_all()
        ended = [Future() for _ in self._workers]
        for worker, future in zip(self._workers, ended, strict=True):
            worker.submit(lambda cancelled: None, partial(self._post, future.set_result))
        for future in ended:
            await future

    def close(self) -> None:
        """Cancel all requests and end the workers."""
        for worker in self._workers:
            worker.close(SHUTDOWN_TIMEOUT)


def _serve(request: PlanRequest | RefusedRequest, improved: Callable[[Plan], None] | None,
           finish: Callable[[Plan], None] | None, cancelled: Callable[[], bool]) -> Plan:
    plan = request.serve(improved, cancelled)
    if finish is not None:
        finish(plan)
    return plan
