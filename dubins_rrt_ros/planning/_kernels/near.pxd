cimport cython
from dubins_rrt_ros.planning._kernels.dubins cimport Curve, Pose
from dubins_rrt_ros.planning._kernels.tree cimport SearchTree

cdef class BackwardNeighbors:
    cdef SearchTree tree
    cdef int count
    cdef int wanted
    cdef double neighbor_radius
    cdef double radius_guess
    cdef double typical_radius
    cdef double cost_budget
    cdef double direction
    cdef Pose pose
    cdef double sin_theta
    cdef double cos_theta
    cdef double[::1] keys
    cdef int[::1] nodes
    cdef signed char[::1] words
    cdef double[:, ::1] lengths
    @cython.final
    cdef void begin(self, Pose pose, double radius) noexcept nogil
    @cython.final
    cdef Curve curve_at(self, int i) noexcept nogil
    @cython.final
    cdef void write(self, int i, int node, Curve curve, double length) noexcept nogil
    @cython.final
    cdef void insert(self, int node, Curve curve) noexcept nogil
    cdef void consider(self, int node, double dx, double dy, double limit) noexcept nogil
    @cython.final
    cdef void consider_bucket(self, int row, int column) noexcept nogil
    @cython.final
    cdef void consider_all(self) noexcept nogil
    cdef void collect_nearest(self, Pose pose, int wanted, double max_length) noexcept nogil
    cdef void collect_useful(self, Pose pose, int wanted, double max_cost, double max_length) noexcept nogil

@cython.final
cdef class ForwardNeighbors(BackwardNeighbors):
    cdef void collect_cheaper(self, int node, double radius, double least_gain) noexcept nogil
