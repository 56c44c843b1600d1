"""`python -m dubins_rrt_ros.node` runs the planner node."""

import sys

from .planner_node import main

sys.exit(main())
