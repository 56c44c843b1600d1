from dubins_rrt_ros.planning._kernels.clearance cimport Clearance

cdef class CollisionChecker:
    cdef Clearance clearance
    cdef readonly double required_clearance
    cdef bint free(self, double x, double y, double theta) noexcept nogil
    cdef bint curve_is_free(self, double x, double y, double theta, double radius, int word,
                            double first, double second, double third) noexcept nogil

cdef class PolygonChecker(CollisionChecker):
    cdef double[:, ::1] discs
    cdef double[:, ::1] corners
    cdef int[::1] first_corner
    cdef double worth
    cdef double[:, ::1] placed
    cdef double[:, ::1] spans
    cdef double rough_gap(self, double x, double y, double theta) noexcept nogil
    cdef bint is_clear(self, double x, double y, double theta, double wider, double ahead) noexcept nogil
    cdef double gap(self, double x, double y, double theta, double expected) noexcept nogil
    cdef double speed(self, double radius, int turn) noexcept nogil
    cdef double straight_is_free(self, double x, double y, double theta, double length, double moved) noexcept nogil
    cdef double turn_is_free(self, double x, double y, double theta, double radius, int turn, double length,
                             double moved) noexcept nogil
    cdef double arc_is_free(self, double x, double y, double theta, double radius, int turn, double length,
                            double moved) noexcept nogil
