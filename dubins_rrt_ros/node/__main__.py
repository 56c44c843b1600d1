"""The command `planner`, which is `python -m dubins_rrt_ros.node` too: run the node, or say that ROS 2 is missing."""

import signal
import sys
from importlib.util import find_spec


def main() -> int:
    """Run the node, and return the exit status: 1 without ROS 2."""
    if find_spec("rclpy") is None:
        print("planner: ROS 2 is not here (no module rclpy); source its setup file, or run: pip install 'dubins_rrt_ros[ros]'",
              file=sys.stderr)
        return 1
    try:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        from .main import main as run
    except KeyboardInterrupt:  # by SIGINT or SIGTERM, which end a node regularly, also while it is imported
        return 0
    return run()


if __name__ == "__main__":
    sys.exit(main())
