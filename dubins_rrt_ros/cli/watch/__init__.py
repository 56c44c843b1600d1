"""`dubins_rrt watch`: the page of `dubins_rrt play` over a running node, which it hears by the topics alone."""
