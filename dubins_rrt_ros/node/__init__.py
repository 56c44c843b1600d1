"""The ROS side: messages are converted, the planner is called, and paths are published. All mathematics is the library's."""
