"""A client that never gets to its end: `client_to_kill.py NAMESPACE get_plan` waits for a plan, `... goals` sends goals."""

import sys

import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.srv import GetPlan

from dubins_rrt_ros.node.conversions import pose_message


def stamped(pose) -> PoseStamped:
    message = PoseStamped(pose=pose_message(pose))
    message.header.frame_id = "map"
    return message


def main(namespace: str, what: str) -> None:
    rclpy.init()
    node = rclpy.create_node("doomed", namespace=namespace)
    start, goal = stamped((1.5, 5.0, 0.0)), stamped((8.5, 5.0, 0.5))
    if what == "get_plan":
        client = node.create_client(GetPlan, "planner/get_plan")
        client.wait_for_service()
        client.call_async(GetPlan.Request(start=start, goal=goal))
        rclpy.spin(node)
    starts, goals = (node.create_publisher(PoseStamped, topic, 1) for topic in ("start_pose", "goal_pose"))
    while True:
        starts.publish(start)
        goals.publish(goal)
        rclpy.spin_once(node, timeout_sec=0.01)


if __name__ == "__main__":
    main(*sys.argv[1:])
