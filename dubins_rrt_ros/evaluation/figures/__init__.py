"""`dubins_rrt figures`: the figures of the documentation."""
