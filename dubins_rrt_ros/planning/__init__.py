"""Dubins RRT and RRT* without ROS.

One verb: plan(problem, settings) -> Plan.
"""

from ._kernels import COMPILED as kernels_compiled
from .audit import Audit, audit_path
from .collision.clearance import ClearanceField
from .curves.dubins import WORDS, CurveError, DubinsCurve
from .curves.path import Path, PathError
from .maps.files import load_map, save_map
from .maps.model import FREE, OCCUPIED, UNKNOWN, GridMap, Map, MapError, MapMetadataError, MapNotFound, PolygonMap, rasterise
from .option import OptionError, options, values
from .planner import plan
from .problem import InvalidPose, Pose, Problem, checked_pose
from .result import Plan, PlanError, Progress, Status
from .search.tree import Tree, TreeError
from .settings import Settings
from .vehicle import Vehicle
from .world import World, prepare

__all__ = [
    "FREE", "OCCUPIED", "UNKNOWN", "WORDS", "Audit", "ClearanceField", "CurveError", "DubinsCurve", "GridMap", "InvalidPose",
    "Map", "MapError", "MapMetadataError", "MapNotFound", "OptionError", "Path", "PathError", "Plan", "PlanError",
    "PolygonMap", "Pose", "Problem", "Progress", "Settings", "Status", "Tree", "TreeError", "Vehicle", "World", "audit_path",
    "checked_pose", "kernels_compiled", "load_map", "options", "plan", "prepare", "rasterise", "save_map", "values",
]
