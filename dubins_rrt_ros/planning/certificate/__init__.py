"""Certificates: paths with a proof of their length, for a checker that trusts nobody (`dubins_rrt_ros/checker`)."""
