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
#: Returns what is left of the published path, None where that does not matter.
Ahead = Callable[[], Path | None]


class PathCheck:
    """Audits what is left of the path on display, in a thread of its own, where the parameters ask for it.

    There is one check at a time, on the newest map that is prepared; where another came meanwhile, the next is on that.
    """

    def __init__(self, node: Node, parameters: Parameters, maps: Maps, outputs: Outputs, queue: ExecutorQueue):
        self._node, self._parameters, self._maps, self._outputs, self._queue = node, parameters, maps, outputs, queue
        self._checked: tuple[Plan, Map] | None = None  # the last ones
        self._is_under_way = False
        self._next: tuple[Ahead, Callable[[], bool], OnVerdict] | None = None  # what was to begin meanwhile
        self._worker = Worker("checks")

    def begin(self, ahead: Ahead, is_due: Callable[[], bool], on_verdict: OnVerdict) -> None:
        """Check the published path, if a map is prepared that came after it, and after the check under way.

        Args:
            ahead: asked when the check begins.
            is_due: asked now and when the verdict is there; False where the path is about to be replaced.
            on_verdict: called with what is wrong with it, if anything.
        """
        if self._is_under_way:
            self._next = ahead, is_due, on_verdict
            return
        shown, world = self._outputs.shown, self._maps.prepared
        if (not is_due() or shown is None or world is None or shown.problem.map is world.map
                or self._checked == (shown, world.map) or not self._parameters.read().node.replan_on_map_change
                or (path := ahead()) is None):
            return
        self._checked, self._is_under_way = (shown, world.map), True
        self._worker.submit(lambda cancelled: _verdict(path, shown.problem, world),
                            lambda verdict: self._queue.post(partial(self._end, shown, is_due, on_verdict, verdict)))

    def _end(self, shown: Plan, is_due: Callable[[], bool], on_verdict: OnVerdict, verdict: Audit | Exception) -> None:
        self._is_under_way = False
        if isinstance(verdict, Exception):
            raise verdict
        if shown is self._outputs.shown and is_due():
            if verdict.ok:
                self._node.get_logger().info("The map changed; the published path is free on it too")
            on_verdict(verdict)
        following, self._next = self._next, None
        if following is not None:
            self.begin(*following)

    def close(self) -> None:
        """End the thread; a check under way cannot be cancelled and ends with the process."""
        self._worker.close(0.0)


def _verdict(path: Path, problem: Problem, world: World) -> Audit:
    return audit_path(path, replace(problem, map=world.map, start=path.start), world.obstacles)
