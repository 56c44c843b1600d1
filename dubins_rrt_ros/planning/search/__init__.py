"""RRT and RRT*, hybrid A*, smoothing, sampling and the cost-to-go, on the kernels and the collision checks."""
