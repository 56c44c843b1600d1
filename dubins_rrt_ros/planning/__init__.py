"""Plan shortest paths of a car that cannot turn on the spot, by RRT and RRT* on Dubins curves, without ROS.

    >>> from dubins_rrt_ros.planning import Problem, Settings, Vehicle, load_map, plan
    >>> problem = Problem(load_map("maps/maze.yaml"), Vehicle(turning_radius=1.0, robot_radius=0.2),
    ...                   start=(1.5, 2.0, 1.57), goal=(13.5, 10.5, 1.57))
    >>> result = plan(problem, Settings(seed=1))
    >>> result.solved, round(result.path.length, 1), result.path.poses(spacing=0.05).shape[1]
    (True, 20.0, 3)

One verb, `plan(problem, settings)`, and its nouns: a `Problem` has a map (`load_map`, `GridMap`, `PolygonMap`), a `Vehicle`, a
start and a goal; a `Plan` has an audited `Path` of Dubins curves, or a `Status` and a message that say why there is none, and the
search `Tree`. `plan_through` plans over waypoints. `prepare` does once for many problems what depends on map and vehicle alone.
Lengths are in metres, angles in radians, times in seconds. Errors that are raised on purpose derive from `PlanningError`.
"""

import warnings

from ._kernels import COMPILED as kernels_compiled
from ._kernels import how_to_compile
from .audit import Audit, audit_path
from .collision.clearance import ClearanceField
from .curves.dubins import WORDS, CurveError, DubinsCurve
from .curves.path import Path, PathError
from .errors import PlanningError
from .hooks import HookError
from .maps.cells import FREE, OCCUPIED, UNKNOWN
from .maps.errors import MapError, MapMetadataError, MapNotFound
from .maps.files import load_map
from .maps.grids import save_map
from .maps.model import GridMap, Map, PolygonMap, Thresholds, rasterise
from .option import OptionError, options, values
from .pictures import PictureError
from .planner import plan
from .problem import InvalidPose, Pose, Problem, checked_pose
from .result import Plan, PlanError, Progress, Status
from .search.tree import Tree, TreeError
from .settings import Settings
from .vehicle import Vehicle
from .waypoints import plan_through
from .world import World, prepare

__all__ = [  # noqa: RUF022 - by what a user needs, in this order
    # what to plan, and how
    "plan", "plan_through", "prepare", "Problem", "Settings", "Vehicle", "World", "load_map",
    # what comes of it
    "Plan", "Progress", "Status", "Path", "DubinsCurve", "Tree", "Audit", "audit_path",
    # maps
    "FREE", "OCCUPIED", "UNKNOWN", "GridMap", "Map", "PolygonMap", "Thresholds", "rasterise", "save_map",
    # errors
    "PlanningError", "CurveError", "HookError", "InvalidPose", "MapError", "MapMetadataError", "MapNotFound", "OptionError",
    "PathError", "PictureError", "PlanError", "TreeError",
    # the rest
    "WORDS", "ClearanceField", "Pose", "checked_pose", "kernels_compiled", "options", "values",
]

if not kernels_compiled:
    warnings.warn(f"the kernels are interpreted, some hundred times slower than compiled; {how_to_compile()}", RuntimeWarning,
                  stacklevel=2)
