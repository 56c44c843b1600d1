"""The quality of service of the node's topics, and what does not fit it."""

from collections.abc import Callable, Iterable

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

VOLATILE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def misfits(publishers: Iterable[TopicEndpointInfo], kind: str) -> list[str]:
    """Why nothing comes from the publishers of a topic, a clause with its remedy for each that does not fit.

    Args:
        publishers: all that there are.
        kind: the topic's type, such as geometry_msgs/msg/PoseStamped.
    """
    return _clauses(publishers, lambda publisher: _misfit(publisher, kind))


def map_misfits(publishers: Iterable[TopicEndpointInfo], transient_local: bool) -> list[str]:
    """The same for the map's topic, where `transient_local` tells what durability the parameter map_transient_local asks for."""
    return _clauses(publishers, lambda publisher: _misfit(publisher, "nav_msgs/msg/OccupancyGrid")
                    or _durability_misfit(publisher, transient_local))


def _clauses(publishers: Iterable[TopicEndpointInfo], misfit: Callable[[TopicEndpointInfo], str]) -> list[str]:
    return [f"{_name(publisher)} {why}" for publisher in publishers if (why := misfit(publisher))]


def _misfit(publisher: TopicEndpointInfo, kind: str) -> str:
    if publisher.topic_type != kind:
        return f"publishes {publisher.topic_type} there, not {kind}; give one of them another name"
    if publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
        return "offers it with best-effort reliability, which does not fit; publish it reliably"
    return ""


def _durability_misfit(publisher: TopicEndpointInfo, transient_local: bool) -> str:
    offered = publisher.qos_profile
    if transient_local and offered.durability == DurabilityPolicy.VOLATILE:
        return "offers it with volatile durability, which does not fit; set map_transient_local to false"
    if not transient_local and offered.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return "offers it with transient local durability, but map_transient_local is false, so that a map from before does " \
               "not come; set map_transient_local to true"
    return ""


def _name(publisher: TopicEndpointInfo) -> str:
    return f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
