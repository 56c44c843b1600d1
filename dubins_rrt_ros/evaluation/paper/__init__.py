"""`dubins_rrt paper`: the paper's figures and table, measured here."""
