"""The map that is planned on: from a file, from the topic, or by service."""

import queue
from collections.abc import Callable
from concurrent import futures
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap, LoadMap
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future

from dubins_rrt_ros.planning import (
    GridMap,
    Map,
    MapError,
    MapMetadataError,
    MapNotFound,
    Vehicle,
    World,
    load_map,
    prepare,
)
from dubins_rrt_ros.planning.collision.footprint import summary
from dubins_rrt_ros.planning.maps.locate import find_map

from .conversions import as_grid, grid_from, grid_message
from .mailbox import Mailbox
from .parameters import NodeOptions, Parameters
from .qos import LATCHED, VOLATILE, map_misfits
from .worker import Worker

#: How long a signal may go unnoticed while the first map is loaded, and how often it is said that it still is [s].
LOADING_INTERVAL, WAITING_INTERVAL = 0.25, 5.0


@dataclass(frozen=True, eq=False)
class MapInUse:
    """A map that is planned on: the map, and the same as a grid, as it is published."""

    map: Map
    grid: GridMap


@dataclass(eq=False)
class Preparation:
    """What plan() needs of a map, for one vehicle.

    Attributes:
        map, inscribed_radius, allow_unknown: what it is for.
        previous: a world that was prepared before, from which what did not change is taken over; None once this one is there, so
            that it is not kept alive any longer.
        world: what is prepared; cancelled where that was not needed any more.
        is_wanted: whether a request waits for it, which it does not any more once there is a newer map.
    """

    map: Map
    inscribed_radius: float
    allow_unknown: bool
    previous: World | None
    world: "futures.Future[World]" = field(default_factory=futures.Future)
    is_wanted: bool = False


class Maps:
    """Keeps the newest map and prepares it in a thread of its own; the services load_map and get_map.

    Args:
        node, parameters, mailbox: the node's.
        on_news: called in the executor's thread when a map was taken or refused.
        on_prepared: called there when the newest is prepared.

    Raises:
        MapError: the parameter map_file names no map that can be used.
    """

    def __init__(self, node: Node, parameters: Parameters, mailbox: Mailbox, on_news: Callable[[], None],
                 on_prepared: Callable[[], None]):
        self._node = node
        self._parameters = parameters
        self._mailbox = mailbox
        self._on_news, self._tell_prepared = on_news, on_prepared
        self._frame = self._options.global_frame
        self._refused = ""  # why the last one was refused
        self.worker = Worker("maps")
        self.current: MapInUse | None = None
        self._preparation: Preparation | None = None
        self._publisher = None
        if self._options.map_file:
            self._publisher = node.create_publisher(OccupancyGrid, "map", LATCHED)
            self._take(*self._load_first(self._options.map_file))
        else:
            qos = LATCHED if self._options.map_transient_local else VOLATILE
            node.create_subscription(OccupancyGrid, "map", self._on_map, qos)
        node.create_service(LoadMap, "~/load_map", self._on_load_map, callback_group=ReentrantCallbackGroup())
        node.create_service(GetMap, "~/get_map", self._on_get_map)

    @property
    def _options(self) -> NodeOptions:
        return self._parameters.read().node

    @property
    def id(self) -> str:
        """Of the current map, "" where there is none."""
        return "" if self.current is None else self.current.map.id

    def missing(self) -> str:
        """Where there is no map yet: on what it waits, why none comes, and what to do."""
        topic = self._node.resolve_topic_name("map")
        found = map_misfits(self._node.get_publishers_info_by_topic(topic), self._options.map_transient_local)
        remedy = " and ".join(found) or "publish it, set map_file or call ~/load_map"
        return f"There is no map yet, waiting for one on {topic}: {remedy}.{self._refused}"

    @property
    def is_prepared(self) -> bool:
        """Whether requests can be planned on the current map without delay."""
        return self.current is not None and self.prepared().world.done()

    def prepared(self) -> Preparation:
        """The preparation of the current map for the present vehicle, begun if it was not."""
        now = self._parameters.read()
        wanted = self.current.map, now.vehicle.inscribed_radius, now.problem["allow_unknown"]
        last = self._preparation
        if last is None or (last.map, last.inscribed_radius, last.allow_unknown) != wanted:
            self._preparation = Preparation(*wanted, _prepared_before(last))
            self.worker.submit(partial(self._prepare, self._preparation, now.vehicle), partial(self._post, self._on_prepared))
        return self._preparation

    def _load_first(self, name: str) -> tuple[Map, GridMap]:
        """Load the map that the node begins with; a signal ends the wait for it."""
        loaded: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.worker.submit(lambda cancelled: self._load(name, ""), loaded.put)
        while (outcome := _within(LOADING_INTERVAL, loaded)) is None:
            if not self._node.context.ok():
                raise ExternalShutdownException
            self._node.get_logger().info(f"Still loading the map {name}", throttle_duration_sec=WAITING_INTERVAL)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    def _load(self, name: str, directory: str) -> tuple[Map, GridMap]:
        """Load a map by its name, from within a directory; "" is any."""
        loaded = load_map(find_map(name), max_map_cells=self._options.max_map_cells, map_directory=directory)
        return loaded, as_grid(loaded)

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            grid = grid_from(message, self._frame, self._options.max_map_cells)
        except MapError as error:
            self._refuse(error)
        else:
            self._take(grid, grid)

    def _refuse(self, error: MapError) -> None:
        self._refused = f" The last one was refused: {error}."
        self._node.get_logger().error(f"A map was refused: {error}")
        self._mailbox.post(self._on_news)

    def _take(self, taken: Map, grid: GridMap) -> None:
        """Plan on this from now on."""
        self.current = MapInUse(taken, grid)
        self._refused = ""
        height, width = grid.data.shape
        self._node.get_logger().info(f"Took a map of {width} x {height} cells: {taken.name}")
        self.prepared()
        if self._publisher is not None:
            self._publisher.publish(self._message(grid))
        self._mailbox.post(self._on_news)

    def _prepare(self, preparation: Preparation, vehicle: Vehicle, cancelled: Callable[[], bool]) -> Preparation:
        try:
            if preparation.is_wanted or preparation.map is self.current.map:
                preparation.map.id  # noqa: B018 - of a large map it takes long, and is kept
                preparation.world.set_result(prepare(preparation.map, vehicle, preparation.allow_unknown, preparation.previous))
        except Exception as error:
            preparation.world.set_exception(error)  # which a request says
            raise
        finally:
            preparation.previous = None
            preparation.world.cancel()  # where it was left out
        return preparation

    def _on_prepared(self, outcome: Preparation | Exception) -> None:
        if isinstance(outcome, Exception):
            raise outcome
        if outcome is self._preparation:
            outline = self._parameters.read().vehicle.footprint
            vehicle = f", for {summary(outline)}" if outline else ""
            self._node.get_logger().info(f"The map is ready, id {outcome.map.id}{vehicle}")
            self._tell_prepared()

    def _post(self, receiver: Callable, outcome: object) -> None:
        self._mailbox.post(partial(receiver, outcome))

    async def _on_load_map(self, request: LoadMap.Request, response: LoadMap.Response) -> LoadMap.Response:
        loaded = Future()
        directory = self._options.map_directory
        self.worker.submit(lambda cancelled: self._load(request.map_url, directory), partial(self._post, loaded.set_result))
        outcome = await loaded
        response.result = _result(outcome)
        if response.result == LoadMap.Response.RESULT_SUCCESS:
            self._take(*outcome)
            response.map = self._message(self.current.grid)
        elif isinstance(outcome, MapError):
            self._refuse(outcome)
        else:
            self._mailbox.post(partial(_raise, outcome))  # a defect: told where all are, and the caller is answered
        return response

    def _on_get_map(self, request: GetMap.Request, response: GetMap.Response) -> GetMap.Response:
        if self.current is None:
            self._node.get_logger().warning(f"get_map gives an empty map: {self.missing()}")
            response.map.header.frame_id = self._frame
        else:
            response.map = self._message(self.current.grid)
        return response

    def _message(self, grid: GridMap) -> OccupancyGrid:
        return grid_message(grid, self._frame, self._node.get_clock().now().to_msg())


def _prepared_before(last: Preparation | None) -> World | None:
    """The newest world that is prepared, as far as the last preparation knows."""
    if last is None or not last.world.done():
        return None if last is None else last.previous
    return None if last.world.cancelled() or last.world.exception() else last.world.result()


def _within(timeout: float, results: queue.SimpleQueue) -> Any:
    """What comes within `timeout` [s], or None."""
    try:
        return results.get(timeout=timeout)
    except queue.Empty:
        return None


def _result(outcome: object) -> int:
    """LoadMap's result code for what came of it."""
    codes = {MapNotFound: LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST,
             MapMetadataError: LoadMap.Response.RESULT_INVALID_MAP_METADATA,
             MapError: LoadMap.Response.RESULT_INVALID_MAP_DATA,
             Exception: LoadMap.Response.RESULT_UNDEFINED_FAILURE}
    return next((code for kind, code in codes.items() if isinstance(outcome, kind)), LoadMap.Response.RESULT_SUCCESS)


def _raise(error: Exception) -> None:
    raise error
