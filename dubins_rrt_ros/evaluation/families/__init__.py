"""`dubins_rrt families`: problems that are solvable by construction, and how many of them are solved."""
