"""`python -m dubins_rrt_ros` is the command `dubins_rrt`."""

import sys

from dubins_rrt_ros.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
