"""`dubins_rrt demo`: the node asked over real topics, by a client of its own."""
