"""The check whether the rest of the published path is still free on a newer map."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from rclpy.node import Node

from dubins_rrt_ros.planning import Audit, Map, Path, Plan, Problem, World, audit_path

from .executor_queue import ExecutorQueue
from .maps import Maps
from .outputs import Outputs
from .parameters import Parameters
from .worker import Worker

#: Called in the executor's thread with the verdict on what is left of the published path.
OnVerdict = Callable[[Audit], None]


class PathCheck:
    """Audits what is left of the path on display, once for each map, in a thread of its own, where the parameters ask for it."""

    def __init__(self, node: Node, parameters: Parameters, maps: Maps, outputs: Outputs, queue: ExecutorQueue):
        self._node, self._parameters, self._maps, self._outputs, self._queue = node, parameters, maps, outputs, queue
        self._checked: tuple[Plan, Map] | None = None  # the last ones
        self._worker = Worker("checks")

    def begin(self, ahead: Callable[[], Path], is_due: Callable[[], bool], on_verdict: OnVerdict) -> None:
        """Check the published path, if the newest map is prepared and came after it.

        Args:
            ahead: returns what is left of it.
            is_due: asked now and when the verdict is there; False where the path is about to be replaced.
            on_verdict: called with what is wrong with it, if anything.
        """
        shown, newest = self._outputs.shown, self._maps.map
        if (not is_due() or shown is None or shown.path is None or newest is None or shown.problem.map is newest
                or self._checked == (shown, newest) or not self._maps.is_prepared
                or not self._parameters.read().node.replan_on_map_change):
            return
        self._checked = shown, newest
        path, world = ahead(), self._maps.world_for_request().result()
        self._worker.submit(lambda cancelled: _verdict(path, shown.problem, world),
                            lambda verdict: self._queue.post(partial(self._end, shown, newest, is_due, on_verdict, verdict)))

    def _end(self, shown: Plan, newest: Map, is_due: Callable[[], bool], on_verdict: OnVerdict,
             verdict: Audit | Exception) -> None:
        if isinstance(verdict, Exception):
            raise verdict
        if shown is not self._outputs.shown or newest is not self._maps.map or not is_due():
            return
        if verdict.ok:
            self._node.get_logger().info("The map changed; the published path is free on it too")
        on_verdict(verdict)

    def close(self) -> None:
        """End the thread; a check under way cannot be cancelled and ends with the process."""
        self._worker.close(0.0)


def _verdict(path: Path, problem: Problem, world: World) -> Audit:
    return audit_path(path, replace(problem, map=world.map, start=path.start), world.obstacles)
