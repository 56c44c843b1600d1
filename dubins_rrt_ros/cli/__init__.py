"""The command line, built on the library. Each command is imported when it is asked for; only `demo` and `watch` use ROS."""
