"""The quality of service of the node's topics, and publishers whose offer does not match it."""

from collections.abc import Callable, Iterable

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dubins_rrt_ros.planning.text import one_line

#: Quality of service of messages that matter only when they are sent: poses.
VOLATILE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
#: Quality of service of messages whose last one late subscribers get too.
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: Quality of service of changes of a map, each of which counts.
UPDATES = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
#: Services: a call beyond the depth would be lost without a word, and ten at once, the depth of ROS' own profile, are soon there.
SERVICE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)


def incompatible_publishers(publishers: Iterable[TopicEndpointInfo], kind: str) -> list[str]:
    """Say for each incompatible publisher of a topic why nothing comes from it, in a clause with the remedy.

    Args:
        publishers: all that there are.
        kind: the topic's type, such as geometry_msgs/msg/PoseStamped.
    """
    return _clauses(publishers, lambda publisher: _incompatibility(publisher, kind))


def incompatible_map_publishers(publishers: Iterable[TopicEndpointInfo], transient_local: bool) -> list[str]:
    """Say the same of the map's publishers, where `transient_local` is the value of the parameter map_transient_local."""
    return _clauses(publishers, lambda publisher: _incompatibility(publisher, "nav_msgs/msg/OccupancyGrid")
                    or _durability_incompatibility(publisher, transient_local))


def _clauses(publishers: Iterable[TopicEndpointInfo], reason: Callable[[TopicEndpointInfo], str]) -> list[str]:
    return [f"{_name(publisher)} {why}" for publisher in publishers if (why := reason(publisher))]


def _incompatibility(publisher: TopicEndpointInfo, kind: str) -> str:
    if publisher.topic_type != kind:
        return f"publishes {one_line(publisher.topic_type)} there, not {kind}; give one of them another name"
    if publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
        return "offers it with best-effort reliability, which does not fit; publish it reliably"
    return ""


def _durability_incompatibility(publisher: TopicEndpointInfo, transient_local: bool) -> str:
    offered = publisher.qos_profile
    if transient_local and offered.durability == DurabilityPolicy.VOLATILE:
        return "offers it with volatile durability, which does not fit; set map_transient_local to false"
    if not transient_local and offered.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return "offers it with transient local durability, but map_transient_local is false, so that a map from before does " \
               "not come; set map_transient_local to true"
    return ""


def _name(publisher: TopicEndpointInfo) -> str:
    return one_line(f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}")
