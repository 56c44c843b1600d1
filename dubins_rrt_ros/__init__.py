"""Dubins RRT and RRT* for ROS 2: collision-free paths for vehicles that cannot turn on the spot."""

__version__ = "0.1.0"
