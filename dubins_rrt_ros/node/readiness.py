"""The node's needs before it can plan: which are missing, why, and what would provide them."""

from dubins_rrt_ros.planning import Map, Pose, Status

from .frames import Frames
from .managed_node import ManagedNode
from .maps import Maps
from .outcome import Outcome
from .outputs import Outputs
from .parameters import Parameters
from .qos import incompatible_map_publishers, incompatible_publishers
from .request import NotYet, Refusal

#: The topics of a start, and their types.
START_TOPICS = {"start_pose": "geometry_msgs/msg/PoseStamped", "initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped"}
#: Time that a goal waits for a start [s]: one that was sent just before may still be under way, as topics keep no common order.
START_GRACE = 0.5


class Readiness:
    """Keeps the start, knows whether map or start are missing, and reports that in log and status.

    Attributes:
        start: the last one by topic, in the global frame; None until one has come that could be used and transformed.
    """

    def __init__(self, node: ManagedNode, parameters: Parameters, maps: Maps, outputs: Outputs, frames: Frames):
        self._node, self._parameters, self._maps, self._outputs, self._frames = node, parameters, maps, outputs, frames
        self.start: Pose | None = None
        self._start_refusal = ""  # why the last start was refused
        self._reported = ""  # what is missing, as it was logged last
        self._map_warnings: tuple[str, tuple[str, ...]] = ("", ())  # of the map of that name that were told last
        self._map_refusal = ""  # why the last map was refused while there was one, as it was reported

    # What planning needs

    def require_map(self) -> Map:
        """Return the newest map.

        Raises:
            Refusal: there is none, or the node is not active.
        """
        if not self._node.is_active:
            raise Refusal(Status.UNKNOWN, "The planner is not active; its lifecycle manager has to activate it first.")
        if self._maps.map is None:
            raise Refusal(Status.NO_MAP, self.missing_map())
        return self._maps.map

    def require_start(self) -> Pose:
        """Return where the vehicle is now, by its frame or by the last start; any thread may ask for it.

        Raises:
            NotYet: it is not known.
            Refusal: its frame is of no use.
        """
        if self._frames.follows_vehicle:
            return self._frames.vehicle()
        start = self.start
        if start is None:
            raise NotYet("a start", START_GRACE, self._no_start)
        return start

    def known_start(self) -> Pose | None:
        """Return the same, and None where it is not known."""
        try:
            return self.require_start()
        except (NotYet, Refusal):
            return None

    def _no_start(self) -> Refusal:
        return Refusal(Status.NO_START, f"There is no start to plan from: {self._remedy_for_start()}")

    @property
    def map_id(self) -> str:
        """The id of the newest map, "" where there is none."""
        return "" if self._maps.map is None else self._maps.map.id

    # What comes

    def take_start(self, start: Pose) -> None:
        """Plan from here from now on."""
        self.start = start
        self._start_refusal = ""
        self.update()

    def refuse_start(self, outcome: Outcome) -> None:
        """Report why a start cannot be used, and forget the one before: the vehicle is no longer there."""
        self.start = None
        before, self._start_refusal = self._start_refusal, f" The last one was refused: {outcome.message}"
        self._reported = self._missing()
        # A stream of them shall not flood the log.
        self._outputs.report(outcome, log=self._start_refusal != before, map_id=self.map_id)

    def update(self) -> bool:
        """Log what is missing where that has changed; a missing map is reported as status too. Return True if it changed.

        The first time a missing start is reported as status as well, and a refused map whenever there is an older one.
        """
        self._report_map()
        before, self._reported = self._reported, self._missing()
        if self._reported == before:
            return False
        self._log()
        if self._maps.map is None:
            self._outputs.report(Outcome(Status.NO_MAP, self._reported), log=False)
        elif self._outputs.status is None and self._reported:
            message = " ".join([self._reported, *self._maps.warnings])
            self._outputs.report(Outcome(Status.NO_START, message), log=False, map_id=self.map_id)
        return True

    def _report_map(self) -> None:
        """Report once, as warnings, what is odd about the newest map, and that a map was refused while there is an older.

        When a newer one is taken after a refusal, that is reported too.
        """
        if self._maps.map is None:
            return
        warnings = self._maps.map.name, self._maps.warnings
        if warnings != self._map_warnings and self._maps.warnings and self._outputs.status is not None:
            outcome = Outcome(Status.NONE, " ".join(self._maps.warnings), is_warning=True)
            self._outputs.report(outcome, log=False, map_id=self.map_id)
        self._map_warnings = warnings
        before, self._map_refusal = self._map_refusal, self._maps.refusal
        if self._map_refusal and self._map_refusal != before:
            message = f"Planning goes on on an older map.{self._map_refusal}"
            self._outputs.report(Outcome(Status.NONE, message, is_warning=True), log=False, map_id=self.map_id)
        elif before and not self._map_refusal:
            self._outputs.report(Outcome(Status.NONE, "The newest map is planned on."), log=False, map_id=self.map_id)

    def remind(self, is_idle: bool) -> None:
        """Log again what is missing, and correct the status where what it misses has come since.

        Args:
            is_idle: True if no goal is planned or waits. The status is corrected then alone, and not when the map or start
                comes: a goal mostly comes with it.
        """
        if not self.update():
            self._log()
        if is_idle and self._maps.map is not None:
            self._correct_status()

    # What is said

    def missing_map(self) -> str:
        """Return a sentence for when there is no map: which topic should bring it, why it does not, and what to do."""
        topic = self._node.resolve_topic_name("map")
        transient_local = self._parameters.read().node.map_transient_local
        found = incompatible_map_publishers(self._node.get_publishers_info_by_topic(topic), transient_local)
        remedy = " and ".join(found) or "publish it, set map_file or call ~/load_map"
        return f"There is no map yet, waiting for one on {topic}: {remedy}.{self._maps.refusal}"

    def _remedy_for_start(self) -> str:
        topics = {self._node.resolve_topic_name(name): kind for name, kind in START_TOPICS.items()}
        found = [clause for topic, kind in topics.items()
                 for clause in incompatible_publishers(self._node.get_publishers_info_by_topic(topic), kind)]
        but = f"; but {' and '.join(found)}" if found else ""
        return f"publish the vehicle's pose on {' or '.join(topics)}{but}.{self._start_refusal}"

    def _missing(self) -> str:
        """Return a sentence on what is missing, "" where nothing is."""
        if self._maps.map is None:
            return self.missing_map()
        has_start = self.start is not None or self._frames.follows_vehicle
        return "" if has_start else f"Waiting for a start: {self._remedy_for_start()}"

    def _log(self) -> None:
        if self._maps.map is None:
            self._node.get_logger().warning(self._reported)
        elif self._reported:
            self._node.get_logger().info(self._reported)

    def _correct_status(self) -> None:
        if self._outputs.status is Status.NO_MAP and self._reported:
            outcome = Outcome(Status.NO_START, self._reported)
        elif self._status_is_outdated and not self._reported:
            outcome = Outcome(Status.NONE, "Ready for a goal.")
        else:
            return
        self._outputs.report(outcome, log=False, map_id=self.map_id)

    @property
    def _status_is_outdated(self) -> bool:
        """True if the last status would be another one now that nothing is missing: it is about no request, or about no map."""
        last = self._outputs
        return last.status is Status.NO_MAP or (last.plan_id == 0 and last.status not in (None, Status.NONE))
