"""The services for maps: load_map and get_map."""

from collections.abc import Callable

from nav_msgs.srv import GetMap, LoadMap
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from dubins_rrt_ros.planning import MapError, MapMetadataError, MapNotFound

from .maps import Maps
from .parameters import Parameters
from .qos import SERVICE
from .readiness import Readiness

#: LoadMap's result codes for the errors of a map, the first that fits.
RESULTS = {MapNotFound: LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST,
           MapMetadataError: LoadMap.Response.RESULT_INVALID_MAP_METADATA,
           MapError: LoadMap.Response.RESULT_INVALID_MAP_DATA,
           Exception: LoadMap.Response.RESULT_UNDEFINED_FAILURE}


class MapServices:
    """Answers ~/load_map and ~/get_map.

    Args:
        node, parameters, maps, readiness: the node's.
        report_defect: called with an error that is no MapError.
        group: for the service that awaits.
    """

    def __init__(self, node: Node, parameters: Parameters, maps: Maps, readiness: Readiness,
                 report_defect: Callable[[Exception], None], group: CallbackGroup):
        self._node, self._parameters, self._maps, self._readiness = node, parameters, maps, readiness
        self._report_defect = report_defect
        node.create_service(LoadMap, "~/load_map", self._on_load_map, qos_profile=SERVICE, callback_group=group)
        node.create_service(GetMap, "~/get_map", self._on_get_map, qos_profile=SERVICE)

    async def _on_load_map(self, request: LoadMap.Request, response: LoadMap.Response) -> LoadMap.Response:
        loaded = Future()
        self._maps.load(request.map_url, self._parameters.read().node.map_directory, loaded.set_result)
        outcome = await loaded
        if not isinstance(outcome, Exception):
            world_map, grid = outcome
            self._maps.take(world_map, grid)
            response.map = self._maps.message(grid)
            response.result = LoadMap.Response.RESULT_SUCCESS
            return response
        response.result = next(code for kind, code in RESULTS.items() if isinstance(outcome, kind))
        if isinstance(outcome, MapError):
            self._maps.refuse(outcome)
        else:
            self._report_defect(outcome)
        return response

    def _on_get_map(self, request: GetMap.Request, response: GetMap.Response) -> GetMap.Response:
        if self._maps.grid is None:
            self._node.get_logger().warning(f"get_map gives an empty map: {self._readiness.missing_map()}")
            response.map.header.frame_id = self._parameters.read().node.global_frame
        else:
            response.map = self._maps.message(self._maps.grid)
        return response
