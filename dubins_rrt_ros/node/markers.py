"""A plan as markers for RViz."""

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from dubins_rrt_ros.planning import Plan
from dubins_rrt_ros.planning.problem import Pose

from .conversions import pose_message

TREE_COLOR = ColorRGBA(r=0.35, g=0.55, b=0.85, a=0.6)
PATH_COLOR = ColorRGBA(r=0.90, g=0.30, b=0.10, a=1.0)
START_COLOR = ColorRGBA(r=0.10, g=0.60, b=0.20, a=1.0)
GOAL_COLOR = ColorRGBA(r=0.75, g=0.10, b=0.50, a=1.0)
FAILURE_COLOR = ColorRGBA(r=0.95, g=0.75, b=0.05, a=0.9)
#: Length of a chord in turning radii; it deviates from its arc by 1 % of the radius.
CHORD = 0.3


def tree_markers(plan: Plan | None, frame: str, stamp: Time, max_lines: int) -> MarkerArray:
    """Return markers that clear what was shown, then show tree, start, goal and path of a plan, and where it failed.

    Args:
        plan: what to show; None to clear only.
        frame, stamp: of every marker.
        max_lines: maximum number of lines of the tree, those of its oldest nodes: a large tree keeps RViz and the node busy.
    """
    header = Header(stamp=stamp, frame_id=frame)
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    if plan is not None:
        radius = plan.problem.vehicle.turning_radius
        width = 0.02 * radius
        markers += _lines(header, "tree", Marker.LINE_LIST, plan.tree.segments(CHORD * radius, max_lines), width, TREE_COLOR)
        markers.append(_arrow(header, "start", plan.problem.start, radius, START_COLOR))
        markers.append(_arrow(header, "goal", plan.problem.goal, radius, GOAL_COLOR))
        if plan.location is not None:
            markers.append(_disc(header, "culprit", plan.location, 0.3 * radius, FAILURE_COLOR))
        if plan.path is not None:
            poses = plan.path.poses(CHORD * radius)
            markers += _lines(header, "path", Marker.LINE_STRIP, poses[:, :2], 3 * width, PATH_COLOR)
    return MarkerArray(markers=markers)


def _lines(header: Header, namespace: str, kind: int, points: np.ndarray, width: float,
           color: ColorRGBA) -> list[Marker]:
    """Return one marker for all lines, or none: RViz complains of lines without points."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    if len(points) < 2:
        return []
    marker = Marker(header=header, ns=namespace, type=kind, action=Marker.ADD, scale=Vector3(x=width), color=color)
    marker.points = [Point(x=x, y=y, z=0.0) for x, y in points.tolist()]
    return [marker]


def _arrow(header: Header, namespace: str, pose: Pose, radius: float, color: ColorRGBA) -> Marker:
    return Marker(header=header, ns=namespace, type=Marker.ARROW, action=Marker.ADD, pose=pose_message(pose),
                  scale=Vector3(x=0.6 * radius, y=0.12 * radius, z=0.12 * radius), color=color)


def _disc(header: Header, namespace: str, point: tuple[float, float], diameter: float, color: ColorRGBA) -> Marker:
    return Marker(header=header, ns=namespace, type=Marker.CYLINDER, action=Marker.ADD, pose=pose_message((*point, 0.0)),
                  scale=Vector3(x=diameter, y=diameter, z=0.02), color=color)
