"""`dubins_rrt play`: a page in the browser where the path follows the mouse."""
