"""The quality of service of the node's topics, and what does not fit it."""

from collections.abc import Iterable

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

VOLATILE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def misfits(publishers: Iterable[TopicEndpointInfo], kind: str, transient_local: bool) -> list[str]:
    """Why nothing comes from the publishers of the map's topic, a clause with its remedy for each that does not fit.

    Args:
        publishers: all that there are.
        kind: the topic's type, such as nav_msgs/msg/OccupancyGrid.
        transient_local: the durability that is asked for, by the parameter map_transient_local.
    """
    return [f"{_name(publisher)} {why}" for publisher in publishers if (why := _misfit(publisher, kind, transient_local))]


def _misfit(publisher: TopicEndpointInfo, kind: str, transient_local: bool) -> str:
    offered = publisher.qos_profile
    if publisher.topic_type != kind:
        return f"publishes {publisher.topic_type} there, not {kind}; give one of them another name"
    if offered.reliability == ReliabilityPolicy.BEST_EFFORT:
        return "offers it with best-effort reliability, which does not fit; publish it reliably"
    if transient_local and offered.durability == DurabilityPolicy.VOLATILE:
        return "offers it with volatile durability, which does not fit; set map_transient_local to false"
    if not transient_local and offered.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return "offers it with transient local durability, but map_transient_local is false, so that a map from before does " \
               "not come; set map_transient_local to true"
    return ""


def _name(publisher: TopicEndpointInfo) -> str:
    return f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
