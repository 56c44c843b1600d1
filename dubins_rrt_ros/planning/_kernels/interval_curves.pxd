cimport cython
from dubins_rrt_ros.planning._kernels.dubins cimport Pose

cdef struct Interval:
    double middle
    double half

cpdef double shortest_of_intervals(double distance, double start, double start_half, double end, double end_half, double radius)
