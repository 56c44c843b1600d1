cimport cython
from dubins_rrt_ros.planning._kernels.dubins cimport Pose
from dubins_rrt_ros.planning._kernels.edge_tree cimport EdgeTree

cdef class Clearance:
    cdef readonly float[:, ::1] field
    cdef readonly double resolution
    cdef readonly double margin
    cdef double x0, y0, cos_yaw, sin_yaw
    cdef readonly double width, height
    cdef double exact(self, double x, double y) noexcept nogil
    @cython.final
    cdef double at_least(self, double x, double y, double enough) noexcept nogil
    @cython.final
    cdef bint point_is_free(self, double x, double y, double required_clearance) noexcept nogil
    @cython.final
    cdef double arc_is_free(self, Pose pose, double radius, int turn, double length, double s,
                            double required_clearance) noexcept nogil
    @cython.final
    cdef bint sweep_is_clear(self, double[:, ::1] corners, int first, int end, double along, double across,
                             double[:, ::1] spans) noexcept nogil
    @cython.final
    cdef void span(self, double x0, double y0, double x1, double y1, double[:, ::1] spans) noexcept nogil
    @cython.final
    cdef int row_of(self, double y) noexcept nogil
    @cython.final
    cdef int column_of(self, double x) noexcept nogil
    cdef bint spans_are_clear(self, int first_row, int last_row, double[:, ::1] spans, double[:, ::1] corners, int first,
                              int end, double along, double across) noexcept nogil

@cython.final
cdef class GridClearance(Clearance):
    cdef readonly int[:, ::1] row_gap
    cdef int[:, ::1] nearest_rows
    cdef double squared_across(self, double x, int row, int column) noexcept nogil
    cdef int find_nearest_rows(self, int row, int column) noexcept nogil
    cdef double squared_cells(self, int row, int column, int away, int nearer) noexcept nogil

@cython.final
cdef class PolygonClearance(Clearance):
    cdef EdgeTree edges
