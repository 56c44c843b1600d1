"""The map that is planned on, from a file, the topic or a service; and the world that is prepared from it."""

import queue
from collections.abc import Callable
from concurrent import futures
from functools import partial
from typing import Any

from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from rclpy.parameter import Parameter

from dubins_rrt_ros.planning import GridMap, Map, MapError, Vehicle, World, load_map, prepare
from dubins_rrt_ros.planning.collision.footprint import summary
from dubins_rrt_ros.planning.maps.locate import find_map
from dubins_rrt_ros.planning.text import one_line

from .conversions import as_grid, grid_from, grid_message, is_same_grid, updated_grid
from .executor_queue import ExecutorQueue
from .outcome import Outcome
from .parameters import NodeOptions, Parameters
from .qos import LATCHED, UPDATES, VOLATILE
from .worker import Worker

try:
    from map_msgs.msg import OccupancyGridUpdate
except ImportError:  # part of an installation of ROS, not of the packages for pip
    OccupancyGridUpdate = None

#: Time between two checks for a signal while the first map is loaded [s].
LOADING_INTERVAL = 0.25
#: Time between two log lines that it is still loaded [s].
STILL_LOADING_INTERVAL = 5.0

#: A map, and the same as the grid that is published of it.
Loaded = tuple[Map, GridMap]


class Maps:
    """Keeps the newest map, and prepares it in a thread of its own.

    Attributes:
        map: what is planned on; None until there is one.
        grid: the same as a grid.
        prepared: the newest world that is prepared, which may be of an older map; None until there is one.
        refusal: a sentence, with a space in front, that says why the last map was refused; "" where it was taken.

    Args:
        node, parameters, queue: the node's.
        on_news: called in the executor's thread when a map was taken or refused.
        on_prepared: called there when a map is prepared, even if a newer one has come meanwhile.

    Raises:
        MapError: the parameter map_file names no map that can be used.
    """

    def __init__(self, node: Node, parameters: Parameters, queue: ExecutorQueue, on_news: Callable[[], None],
                 on_prepared: Callable[[], None]):
        self._node, self._parameters, self._queue = node, parameters, queue
        self._on_news, self._on_prepared = on_news, on_prepared
        self._frame = self._options.global_frame
        self.map: Map | None = None
        self.grid: GridMap | None = None
        self.prepared: World | None = None
        self.refusal = ""
        self._came_by_topic = False
        self._worker = Worker("maps")
        self._world: futures.Future[World] = futures.Future()  # of the newest map
        # Map, required clearance, allow_unknown, and whether cells have costs.
        self._world_is_of: tuple[Map, float, bool, bool] | None = None
        self._world_is_wanted = False  # by a request, whatever map comes next
        self._publisher = node.create_publisher(OccupancyGrid, "map", LATCHED) if self._options.map_file else None
        if self._options.map_file:
            try:
                self.take(*self._load_first(self._options.map_file))
            except MapError:
                self._worker.close(0.0)
                raise
        else:
            qos = LATCHED if self._options.map_transient_local else VOLATILE
            node.create_subscription(OccupancyGrid, "map", self._on_map, qos)
            if OccupancyGridUpdate is not None:
                node.create_subscription(OccupancyGridUpdate, "map_updates", self._on_update, UPDATES)
        node.add_post_set_parameters_callback(self._on_parameters)

    @property
    def _options(self) -> NodeOptions:
        return self._parameters.read().node

    # Worlds

    def world_for_request(self) -> "futures.Future[World]":
        """Return the world of the newest map, as it will be: for this request it is prepared even if another map comes first."""
        world = self._newest_world()
        self._world_is_wanted = True
        return world

    def _newest_world(self) -> "futures.Future[World]":
        """Return the world of the newest map for the present vehicle; it is prepared if it was not asked for before."""
        if self.map is not None:
            now = self._parameters.read()
            allow_unknown = now.problem["allow_unknown"]
            has_costs = now.settings.weight_of_cells > 0
            wanted = self.map, now.vehicle.required_clearance, allow_unknown, has_costs
            if self._world_is_of != wanted:
                self._renew_world()
                self._world_is_of = wanted
                self._worker.submit(partial(self._prepare, self._world, self.map, now.vehicle, allow_unknown, has_costs),
                                    partial(self._post, self._end_preparation))
        return self._world

    def _renew_world(self) -> None:
        if not self._world_is_wanted:
            self._world.cancel()  # if it is not being prepared yet
        self._world, self._world_is_wanted = futures.Future(), False

    def _prepare(self, world: "futures.Future[World]", world_map: Map, vehicle: Vehicle, allow_unknown: bool,
                 has_costs: bool, cancelled: Callable[[], bool]) -> World | None:
        if not world.set_running_or_notify_cancel():
            return None
        try:
            world_map = world_map.with_costs(has_costs)
            world_map.id  # noqa: B018 - takes long for a large map, and is kept
            self.prepared = prepare(world_map, vehicle, allow_unknown, self.prepared)
        except Exception as error:
            world.set_exception(error)  # which a request reports
            raise
        world.set_result(self.prepared)
        return self.prepared

    def _end_preparation(self, outcome: World | Exception | None) -> None:
        if isinstance(outcome, Exception):
            raise outcome
        if outcome is not None:
            outline = self._parameters.read().vehicle.footprint
            vehicle = f", for {summary(outline)}" if outline else ""
            self._node.get_logger().info(f"The map is ready, id {outcome.map.id}{vehicle}")
            self._on_prepared()

    # Maps

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for a person about how the newest map was understood."""
        return self.map.warnings if self.map else ()

    def take(self, world_map: Map, grid: GridMap, by_topic: bool = False) -> None:
        """Plan on this map, which looks like this grid, from now on."""
        told = self.warnings if by_topic and self._came_by_topic else ()  # of a stream of maps each is logged once
        self.map, self.grid, self.refusal = world_map, grid, ""
        self._came_by_topic = by_topic
        height, width = grid.data.shape
        shares = "" if by_topic else f", {grid.describe_cells()}"  # which takes too long for each map of a stream
        self._node.get_logger().info(f"Took a map of {width} x {height} cells: {one_line(world_map.name)}{shares}")
        for warning in self.warnings:
            if warning not in told:
                self._node.get_logger().warning(warning)
        self._newest_world()
        if self._publisher is not None:
            self._publisher.publish(self.message(grid))
        self._queue.post(self._on_news)

    def refuse(self, error: MapError, log_again: bool = True) -> None:
        """Report why a map cannot be used; the one before stays. It is logged, `log_again` or not, where the reason is new."""
        reason = str(error).removesuffix(".")
        before, self.refusal = self.refusal, f" The last one was refused: {reason}."
        if log_again or self.refusal != before:
            self._node.get_logger().error(f"A map was refused: {reason}")
        self._queue.post(self._on_news)

    def with_remark(self, outcome: Outcome) -> Outcome:
        """Return the outcome of a request; where the last map was refused, its message says that it is about an older one."""
        if not self.refusal or outcome.plan is None:
            return outcome
        return outcome._replace(message=f"{outcome.message} This is on an older map.{self.refusal}")

    def load(self, name: str, directory: str, on_end: Callable[[Loaded | Exception], None]) -> None:
        """Load a map in the worker's thread.

        Args:
            name: a file, its URL, or the name of an installed map.
            directory: where the file must be; "" is anywhere.
            on_end: called in the executor's thread with the map, or with why there is none.
        """
        self._worker.submit(lambda cancelled: self._load(name, directory), partial(self._post, on_end))

    def message(self, grid: GridMap) -> OccupancyGrid:
        """Return a grid as a message that is stamped now."""
        return grid_message(grid, self._frame, self._node.get_clock().now().to_msg())

    def close(self) -> None:
        """End the thread; a preparation under way cannot be cancelled and ends with the process."""
        self._node.remove_post_set_parameters_callback(self._on_parameters)
        self._worker.close(0.0)

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            grid = grid_from(message, self._frame, self._options.max_map_cells, self._options.thresholds)
        except MapError as error:
            self.refuse(error, log_again=False)  # it may come each second
        else:
            if self._came_by_topic and self.grid is not None and is_same_grid(grid, self.grid):
                self._keep()
            else:
                self.take(grid, grid, by_topic=True)

    def _on_update(self, message: Any) -> None:
        """Take the map that came by topic with a part of it changed; before there is one, a part says nothing."""
        if not self._came_by_topic or self.grid is None:
            return
        try:
            grid = updated_grid(self.grid, message, self._frame)
        except MapError as error:
            self.refuse(error, log_again=False)
        else:
            if grid is not self.grid:
                self.take(grid, grid, by_topic=True)
            else:
                self._keep()

    def _keep(self) -> None:
        """Stay with the map, which came again, or of which nothing changed: a publisher may repeat it each second."""
        if self.refusal:
            self.refusal = ""
            self._queue.post(self._on_news)

    def _on_parameters(self, changes: list[Parameter]) -> None:
        """Take the map that came by topic by other thresholds, where these changed."""
        thresholds = self._options.thresholds
        if self._came_by_topic and self.grid is not None and self.grid.thresholds != thresholds:
            grid = self.grid.with_thresholds(thresholds)
            self.take(grid, grid, by_topic=True)

    def _load_first(self, name: str) -> Loaded:
        """Load the map that the node begins with, in the worker: a signal ends the wait for it."""
        loaded: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._worker.submit(lambda cancelled: self._load(name, ""), loaded.put)
        while (outcome := _next_of(loaded, LOADING_INTERVAL)) is None:
            self._node.get_logger().info(f"Still loading the map {one_line(name)}", throttle_duration_sec=STILL_LOADING_INTERVAL)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    def _load(self, name: str, directory: str) -> Loaded:
        options = self._options
        loaded = load_map(find_map(name), max_map_cells=options.max_map_cells, map_directory=directory,
                          unknown_grey=options.unknown_grey)
        return loaded, as_grid(loaded)

    def _post(self, receiver: Callable[[Any], None], outcome: object) -> None:
        self._queue.post(partial(receiver, outcome))


def _next_of(results: "queue.SimpleQueue[Any]", timeout: float) -> Any:
    """Return what comes within `timeout` [s], or None."""
    try:
        return results.get(timeout=timeout)
    except queue.Empty:
        return None
