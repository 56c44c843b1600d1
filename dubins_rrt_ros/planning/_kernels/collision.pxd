cimport cython
from dubins_rrt_ros.planning._kernels.clearance cimport Clearance
from dubins_rrt_ros.planning._kernels.dubins cimport Curve, Pose

cdef class CollisionChecker:
    cdef Clearance clearance
    cdef readonly double required_clearance
    cdef bint pose_is_free(self, Pose pose) noexcept nogil
    cdef bint motion_is_free(self, Pose pose, double radius, Curve curve) noexcept nogil
    cdef double arc_is_free(self, Pose pose, double radius, int turn, double length, double walked) noexcept nogil

@cython.final
cdef class PolygonChecker(CollisionChecker):
    cdef double[:, ::1] discs
    cdef double[:, ::1] corners
    cdef int[::1] first_corner
    cdef double[:, ::1] part_discs
    cdef double[:, ::1] hull
    cdef double[:, ::1] outline
    cdef double worth
    cdef double[:, ::1] placed
    cdef double[:, ::1] spans
    cdef int touching
    cdef double rough_gap(self, Pose pose) noexcept nogil
    cdef bint is_clear(self, Pose pose, double wider, double ahead) noexcept nogil
    cdef bint part_is_far(self, int part, double column, double row, double cos_theta, double sin_theta,
                          double wider) noexcept nogil
    cdef void place(self, double[:, ::1] corners, int first, int end, double column, double row, double cos_theta,
                    double sin_theta, double wider) noexcept nogil
    cdef double gap(self, Pose pose, double expected) noexcept nogil
    cdef double straight_is_free(self, Pose pose, double length, double walked) noexcept nogil
    cdef double turn_is_free(self, Pose pose, double radius, int turn, double length, double walked) noexcept nogil

@cython.final
cdef class TestedChecker(CollisionChecker):
    cdef CollisionChecker checker
    cdef object test
