"""`dubins_rrt demo`: the node asked over real topics. The only command that uses ROS."""
