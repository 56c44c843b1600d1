"""The outcome of a request: a plan, a refusal or a defect. Nothing that comes in ends the node."""

import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from rclpy.node import Node

from dubins_rrt_ros.planning import InvalidPose, Plan, Status

from .request import Refusal

#: What can cure a failure; any other stays until the next goal.
CURES = {Status.NO_MAP: "map", Status.NO_START: "start", Status.TF_ERROR: "transform", Status.GOAL_OUTSIDE_MAP: "map",
         Status.GOAL_OCCUPIED: "map", Status.START_OUTSIDE_MAP: "map or a start", Status.START_OCCUPIED: "map or a start",
         Status.NO_VALID_PATH: "map or a start", Status.TIMEOUT: "map or a start"}
#: Failures for lack of what can cure them; of any other there is one already, with which it failed.
MISSING = (Status.NO_MAP, Status.NO_START, Status.TF_ERROR)


class Outcome(NamedTuple):
    """A status, the sentence that explains it and, where a planner ran, its plan.

    Attributes:
        status, message, plan: these.
        is_warning: True if it is no failure, but a person should look at it.
        is_final: True if nothing that may come can cure it, as it otherwise could.
    """

    status: Status
    message: str
    plan: Plan | None = None
    is_warning: bool = False
    is_final: bool = False

    @property
    def cure(self) -> str:
        """The inputs that can cure this failure, in words; "" where there are none."""
        return "" if self.is_final else CURES.get(self.status, "")

    @property
    def waiting_message(self) -> str:
        """The sentence that says what this failure waits for, and why."""
        present = "ones" if " or " in self.cure else "one"
        why = ("the goal stands, and is planned when one comes" if self.status in MISSING
               else f"the goal failed with the present {present}, and is planned again when another comes")
        return f"Waiting for a {self.cure}: {why}. {self.message}"


def outcome_of(result: Plan | Exception, node: Node) -> Outcome:
    """Return the outcome for what a request gave or raised; the trace of a defect goes to the node's log."""
    if isinstance(result, Plan):
        return Outcome(result.status, result.message, result)
    if isinstance(result, Refusal):
        return Outcome(result.status, str(result), is_final=result.is_final)
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
