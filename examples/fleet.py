"""Ask the planners of several robots at once, each in a namespace of its own: fleet.py NAMESPACE ...

Start them with: ros2 run dubins_rrt_ros planner --ros-args -r __ns:=/robot1 -p map_file:=maze
"""

import sys

import rclpy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav2_msgs.action import ComputePathToPose
from rclpy.action import ActionClient
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Header


def facing_up(x: float, y: float) -> PoseStamped:
    """Return a pose in the frame of the map, which all robots share."""
    rotation = Quaternion(z=0.7071, w=0.7071)
    return PoseStamped(header=Header(frame_id="map"), pose=Pose(position=Point(x=x, y=y), orientation=rotation))


async def path_of(client: ActionClient, goal: ComputePathToPose.Goal) -> ComputePathToPose.Result:
    """Return the result of a goal, while the other robots' goals go on."""
    handle = await client.send_goal_async(goal)
    return (await handle.get_result_async()).result


def main() -> int:
    """Print how each robot's request ended; return the exit status."""
    rclpy.init(args=sys.argv)
    node = rclpy.create_node("fleet")
    names = remove_ros_args(sys.argv)[1:]
    clients = {name: ActionClient(node, ComputePathToPose, f"{name}/compute_path_to_pose") for name in names}
    for name, client in clients.items():
        if not client.wait_for_server(timeout_sec=10.0):
            print(f"no planner in {name}", file=sys.stderr)
            return 1
    executor = rclpy.get_global_executor()
    executor.add_node(node)
    goal = ComputePathToPose.Goal(start=facing_up(1.5, 2.0), goal=facing_up(13.5, 10.5), use_start=True)
    tasks: dict[str, Future] = {name: executor.create_task(path_of, client, goal) for name, client in clients.items()}
    for name, task in tasks.items():
        executor.spin_until_future_complete(task)
        print(f"{name}: {task.result().error_msg}")
    rclpy.shutdown()
    return int(any(task.result().error_code for task in tasks.values()))


if __name__ == "__main__":
    sys.exit(main())
