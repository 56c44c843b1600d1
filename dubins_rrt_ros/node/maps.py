"""The map that is planned on: from a file, from the topic, or by service."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap, LoadMap
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from dubins_rrt_ros.planning import GridMap, Map, MapError, MapMetadataError, MapNotFound, load_map, prepare
from dubins_rrt_ros.share import find_map

from .conversions import as_grid, grid_from, grid_message
from .mailbox import Mailbox
from .parameters import Configuration, NodeOptions, Parameters
from .qos import LATCHED, VOLATILE, misfits
from .worker import Worker


@dataclass(frozen=True, eq=False)
class MapInUse:
    """A map that is planned on.

    Attributes:
        map: the map.
        grid: the same as a grid, as it is published.
        prepared: set once what plan() needs of it is computed.
    """

    map: Map
    grid: GridMap
    prepared: threading.Event


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
        self._publisher = None
        if self._options.map_file:
            self._publisher = node.create_publisher(OccupancyGrid, "map", LATCHED)
            self._take(*self._load(self._options.map_file))
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
        found = misfits(self._node.get_publishers_info_by_topic(topic), "nav_msgs/msg/OccupancyGrid",
                        self._options.map_transient_local)
        remedy = " and ".join(found) or "publish it, set map_file or call ~/load_map"
        return f"There is no map yet, waiting for one on {topic}: {remedy}.{self._refused}"

    def _load(self, name: str) -> tuple[Map, GridMap]:
        loaded = load_map(find_map(name), max_map_cells=self._options.max_map_cells)
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
        self.current = MapInUse(taken, grid, threading.Event())
        self._refused = ""
        height, width = grid.data.shape
        self._node.get_logger().info(f"Took a map of {width} x {height} cells: {taken.name}")
        job = partial(self._prepare, self.current, self._parameters.read())
        self.worker.submit(job, partial(self._post, self._on_prepared))
        if self._publisher is not None:
            self._publisher.publish(self._message(grid))
        self._mailbox.post(self._on_news)

    def _prepare(self, used: MapInUse, now: Configuration, cancelled: Callable[[], bool]) -> MapInUse:
        try:
            if used is self.current and not cancelled():  # else there is a newer one already
                prepare(used.map, now.vehicle, now.problem["allow_unknown"])
        finally:
            used.prepared.set()  # also where it failed, which plan() then says of the request
        return used

    def _on_prepared(self, outcome: MapInUse | Exception) -> None:
        if isinstance(outcome, Exception):
            raise outcome
        if outcome is self.current:
            self._node.get_logger().info(f"The map is ready, id {outcome.map.id}")
            self._tell_prepared()

    def _post(self, receiver: Callable, outcome: object) -> None:
        self._mailbox.post(partial(receiver, outcome))

    async def _on_load_map(self, request: LoadMap.Request, response: LoadMap.Response) -> LoadMap.Response:
        loaded = Future()
        self.worker.submit(lambda cancelled: self._load(request.map_url), partial(self._post, loaded.set_result))
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


def _result(outcome: object) -> int:
    """LoadMap's result code for what came of it."""
    codes = {MapNotFound: LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST,
             MapMetadataError: LoadMap.Response.RESULT_INVALID_MAP_METADATA,
             MapError: LoadMap.Response.RESULT_INVALID_MAP_DATA,
             Exception: LoadMap.Response.RESULT_UNDEFINED_FAILURE}
    return next((code for kind, code in codes.items() if isinstance(outcome, kind)), LoadMap.Response.RESULT_SUCCESS)


def _raise(error: Exception) -> None:
    raise error
