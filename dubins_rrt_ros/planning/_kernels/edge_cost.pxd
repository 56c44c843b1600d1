cimport cython
from dubins_rrt_ros.planning._kernels.cell_costs cimport CellCosts
from dubins_rrt_ros.planning._kernels.dubins cimport Curve, Pose
from dubins_rrt_ros.planning._kernels.room cimport Room

@cython.final
cdef class EdgeCost:
    cdef readonly bint is_length
    cdef bint has_room
    cdef bint has_cells
    cdef Room room
    cdef CellCosts cells
    cdef readonly double preferred_clearance
    cdef readonly double weight
    cdef readonly double cell_weight
    # The arc under way.
    cdef Pose pose
    cdef double room_here
    cdef double sine
    cdef double cosine
    cdef double radius
    cdef int turn
    cdef double of(self, Pose pose, double radius, Curve curve, double limit) noexcept nogil
    cdef double excess_of_arc(self, double length, double limit) noexcept nogil
    cdef void begin_arc(self, Pose pose, int turn) noexcept nogil
    cdef double room_at(self, double s) noexcept nogil
    cdef double rate_at(self, double s) noexcept nogil
    cdef double rate(self, double room) noexcept nogil
    cdef double between(self, double begin, double size, double at_begin, double at_middle, double at_end, int halvings) noexcept nogil
