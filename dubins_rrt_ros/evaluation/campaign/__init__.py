"""`dubins_rrt campaign`: random problems, every answer judged."""
