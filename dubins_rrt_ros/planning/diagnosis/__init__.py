"""The reasons why there is no path, in sentences with figures, from the map, the clearance and the tree of the search."""
