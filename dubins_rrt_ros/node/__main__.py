"""Entry point of `python -m dubins_rrt_ros.node`, which runs the planner node."""

import sys

from .main import main

sys.exit(main())
