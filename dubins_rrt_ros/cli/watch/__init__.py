"""`dubins_rrt watch`: the page of `dubins_rrt play` over a running node."""
