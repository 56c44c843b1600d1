from dubins_rrt_ros.planning._kernels.clearance cimport Clearance
from dubins_rrt_ros.planning._kernels.eikonal cimport Eikonal

cdef class CostField:
    cdef readonly tuple shape
    cdef readonly double side
    cdef Clearance clearance
    cdef Eikonal equation
    cdef double column, row, tolerance
    cdef readonly bint is_bound
    cdef bint is_flat
    cdef int width, size
    cdef signed char[::1] free
    cdef double[::1] cost
    cdef double at(self, double x, double y) noexcept nogil
    cdef double at_place(self, double column, double row) noexcept nogil
    cdef double heading(self, double x, double y) noexcept nogil
    cdef (double, double) place(self, double x, double y) noexcept nogil
    cdef int square_at(self, double column, double row) noexcept nogil
    cdef double within(self, int square, double along, double across) noexcept nogil
    cdef double fall(self, int node, int step, int beside) noexcept nogil
    cdef void measure(self, double source) noexcept nogil
