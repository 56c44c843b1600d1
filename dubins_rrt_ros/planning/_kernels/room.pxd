cimport cython
from dubins_rrt_ros.planning._kernels.clearance cimport Clearance
from dubins_rrt_ros.planning._kernels.dubins cimport Pose

@cython.final
cdef class CornerIndex:
    cdef readonly double side
    cdef int rows, columns
    cdef int[::1] first
    cdef double[:, ::1] points
    cdef int row_of(self, double y) noexcept nogil
    cdef int column_of(self, double x) noexcept nogil
    cdef double nearest(self, double[:, ::1] outline, double within) noexcept nogil

cdef class Room:
    cdef Clearance clearance
    cdef double radius
    cdef double at(self, Pose pose, double enough) noexcept nogil
    cdef double speed(self, double radius, int turn) noexcept nogil

@cython.final
cdef class FootprintRoom(Room):
    cdef CornerIndex corners
    cdef double[:, ::1] discs
    cdef double[:, ::1] outline
    cdef double[:, ::1] placed
    cdef double discs_at_least(self, double x, double y, double sine, double cosine, double enough) noexcept nogil
    cdef double outline_at_least(self, double x, double y, double sine, double cosine, double enough) noexcept nogil
