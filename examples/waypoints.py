"""Ask for a path over waypoints, by Nav2's action: waypoints.py X Y YAW X Y YAW ... (the start, the waypoints, the goal)."""

import math
import sys

import rclpy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav2_msgs.action import ComputePathThroughPoses
from rclpy.action import ActionClient
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Header


def stamped(x: float, y: float, yaw: float) -> PoseStamped:
    """Return a pose in the frame of the map."""
    rotation = Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return PoseStamped(header=Header(frame_id="map"), pose=Pose(position=Point(x=x, y=y), orientation=rotation))


def main() -> int:
    """Print the path's length, or why there is none; return the exit status."""
    numbers = list(map(float, remove_ros_args(sys.argv)[1:]))
    start, *goals = [stamped(*numbers[i:i + 3]) for i in range(0, len(numbers), 3)]
    rclpy.init(args=sys.argv)
    node = rclpy.create_node("waypoints")
    client = ActionClient(node, ComputePathThroughPoses, "compute_path_through_poses")
    if not client.wait_for_server(timeout_sec=10.0):
        print("no planner serves compute_path_through_poses", file=sys.stderr)
        return 1
    sent = client.send_goal_async(ComputePathThroughPoses.Goal(start=start, goals=goals, use_start=True))
    rclpy.spin_until_future_complete(node, sent)
    answered = sent.result().get_result_async()
    rclpy.spin_until_future_complete(node, answered)
    result = answered.result().result
    rclpy.shutdown()
    if result.error_code:
        print(f"{result.error_code}: {result.error_msg}", file=sys.stderr)
        return 1
    places = [(pose.pose.position.x, pose.pose.position.y) for pose in result.path.poses]
    print(f"{len(goals)} goals, {sum(map(math.dist, places, places[1:])):.2f} m, {len(places)} poses")
    return 0


if __name__ == "__main__":
    sys.exit(main())
