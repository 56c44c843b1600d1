"""Dubins RRT and RRT* without ROS.

One verb: plan(problem, settings) -> Plan.
"""

from ._kernels import COMPILED as kernels_compiled
from .audit import Audit, audit
from .clearance import ClearanceField
from .dubins import WORDS, CurveError, DubinsCurve
from .map import FREE, OCCUPIED, UNKNOWN, GridMap, Map, MapError, MapMetadataError, MapNotFound, PolygonMap, rasterise
from .map_files import load_map, save_map
from .options import OptionError, options, values
from .path import Path, PathError
from .planner import plan, prepare
from .problem import InvalidPose, Pose, Problem, checked_pose
from .result import Plan, PlanError, Progress, Status
from .settings import Settings
from .tree import Tree, TreeError
from .vehicle import Vehicle

__all__ = [
    "FREE", "OCCUPIED", "UNKNOWN", "WORDS", "Audit", "ClearanceField", "CurveError", "DubinsCurve", "GridMap", "InvalidPose",
    "Map", "MapError", "MapMetadataError", "MapNotFound", "OptionError", "Path", "PathError", "Plan", "PlanError",
    "PolygonMap", "Pose", "Problem", "Progress", "Settings", "Status", "Tree", "TreeError", "Vehicle", "audit",
    "checked_pose", "kernels_compiled", "load_map", "options", "plan", "prepare", "rasterise", "save_map", "values",
]
