cimport cython
from dubins_rrt_ros.planning._kernels.clearance cimport Clearance
from dubins_rrt_ros.planning._kernels.heap cimport Heap

@cython.final
cdef class WidestPathSearch:
    cdef Clearance clearance
    cdef int rows
    cdef int columns
    cdef double x0
    cdef double y0
    cdef double along_x
    cdef double along_y
    cdef double least
    cdef double level
    cdef signed char[::1] is_target
    cdef signed char[::1] entered
    cdef int[::1] queue
    cdef int queued
    cdef int served
    cdef int target
    cdef Heap heap
    cdef int flood(self, int nodes) noexcept nogil
    cdef void enter(self, int node, signed char how) noexcept nogil
