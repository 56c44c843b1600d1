cimport cython
from dubins_rrt_ros.planning._kernels.dubins cimport Pose

@cython.final
cdef class CellCosts:
    cdef const unsigned char[:, ::1] costs
    cdef const unsigned char[:, ::1] free_of_cost
    cdef double resolution
    cdef int rows, columns
    cdef double x0, y0, yaw, sin_yaw, cos_yaw
    # The arc under way: where it begins, or the middle of its circle, and the direction from there; in cells.
    cdef int turn
    cdef double radius, column, row, sine, cosine, direction
    cdef double integral(self, Pose pose, double radius, int turn, double length, double limit) noexcept nogil
    cdef void begin(self, Pose pose, double radius, int turn) noexcept nogil
    cdef (double, double) place_at(self, double s) noexcept nogil
    cdef int free_of_cost_at(self, double column, double row) noexcept nogil
    cdef double cost_at(self, double column, double row) noexcept nogil
    cdef double to_edge(self, double s, double column, double row) noexcept nogil
    cdef double angle_to(self, double direction, double line) noexcept nogil
    cdef double angle_between(self, double direction, double other) noexcept nogil
