from dubins_rrt_ros.planning._kernels.dubins cimport Curve

cdef double edge_cost(Curve curve) noexcept nogil
