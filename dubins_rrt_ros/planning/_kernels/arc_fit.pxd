cimport cython
from dubins_rrt_ros.planning._kernels.clearance cimport Clearance
from dubins_rrt_ros.planning._kernels.dubins cimport Pose

@cython.final
cdef class ArcFit:
    cdef Clearance clearance
    cdef double radius, required, spacing
    cdef readonly double largest
    cdef readonly bint measured, differentiated
    cdef Pose start, goal
    cdef int[::1] turns, arcs
    cdef double[:, ::1] points, samples
    cdef readonly double[:, ::1] ends
    cdef double[::1] lengths, row, errors
    cdef Py_ssize_t size, next_sample
    cdef int next_arc
    cdef double measure_goal(self) noexcept nogil
    cdef double measure_arc(self, int arc, double length, double limit) noexcept nogil
    cdef double measure_point(self, int arc, double share, double length, Pose begin, double sine, double cosine, Py_ssize_t point) noexcept nogil
    cdef void accumulate(self, int n, double residual, double[::1] gradient, double[:, ::1] curvature) noexcept nogil
    cdef void differentiate_goal(self, Py_ssize_t which) noexcept nogil
    cdef void differentiate_sample(self, Py_ssize_t i) noexcept nogil
    cdef double motion(self, int arc, double x, double y, double along_x, double along_y) noexcept nogil
