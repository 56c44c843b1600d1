"""The ROS side: convert, call the planner, publish."""
