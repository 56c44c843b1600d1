"""The Dubins curve and the path: what a vehicle drives between two poses. They know no map and no obstacle."""
