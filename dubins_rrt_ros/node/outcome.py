"""The outcome of a request: a plan, a refusal or a defect. Nothing that comes in ends the node."""

import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from rclpy.node import Node

from dubins_rrt_ros.planning import InvalidPose, Plan, Status

from .request import Refusal


class Outcome(NamedTuple):
    """A status, the sentence that explains it and, where a planner ran, its plan.

    Attributes:
        status, message, plan: these.
        is_warning: True if it is no failure, but a person should look at it.
    """

    status: Status
    message: str
    plan: Plan | None = None
    is_warning: bool = False


def outcome_of(result: Plan | Exception, node: Node) -> Outcome:
    """Return the outcome for what a request gave or raised; the trace of a defect goes to the node's log."""
    if isinstance(result, Plan):
        return Outcome(result.status, result.message, result)
    if isinstance(result, Refusal):
        return Outcome(result.status, str(result))
    if isinstance(result, InvalidPose):
        return Outcome(Status.INVALID_POSE, str(result))
    node.get_logger().error("".join(traceback.format_exception(result)))
    return Outcome(Status.UNKNOWN, f"A defect in the planner ({type(result).__name__}: {result}); its trace is in the log, "
                                   "please report it.")


@contextmanager
def failures_reported(node: Node, report: Callable[[Outcome], None]) -> Iterator[None]:
    """Report what is raised within, refusals and defects, as an outcome."""
    try:
        yield
    except Exception as error:
        if not node.context.ok():  # a signal shut it down meanwhile: nothing can be published any more
            raise
        report(outcome_of(error, node))
