cimport cython
from dubins_rrt_ros.planning._kernels.clearance cimport Clearance
from dubins_rrt_ros.planning._kernels.eikonal cimport Eikonal

@cython.final
cdef class CostToGoKernel:
    cdef readonly tuple shape
    cdef readonly double side
    cdef Clearance clearance
    cdef object squares, slowness
    cdef Eikonal equation, flat
    cdef double column, row, tolerance, deduction
    cdef readonly bint is_bound
    cdef int width, size
    cdef signed char[::1] free
    cdef double[::1] cost
    cdef double at(self, double x, double y) noexcept nogil
    cdef double squares_to(self, double column, double row) noexcept nogil
    cdef double heading(self, double x, double y) noexcept nogil
    cdef (double, double) place(self, double x, double y) noexcept nogil
    cdef int square_at(self, double column, double row) noexcept nogil
    cdef double within(self, int square, double along, double across) noexcept nogil
    cdef double fall(self, int node, int step, int across) noexcept nogil
