"""`dubins_rrt bench`: time and path length over problems and seeds."""
