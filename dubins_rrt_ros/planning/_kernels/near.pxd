cimport cython
from dubins_rrt_ros.planning._kernels.tree cimport SearchTree

cdef class BackwardNeighbors:
    cdef SearchTree tree
    cdef int count
    cdef int wanted
    cdef double neighbor_radius
    cdef double radius_guess
    cdef double typical_radius
    cdef double cost_budget
    cdef double ahead
    cdef double x
    cdef double y
    cdef double theta
    cdef double sin_theta
    cdef double cos_theta
    cdef double[::1] keys
    cdef int[::1] nodes
    cdef signed char[::1] words
    cdef double[:, ::1] lengths
    @cython.final
    cdef void begin(self, double x, double y, double theta, double neighbor_radius) noexcept nogil
    @cython.final
    cdef void insert(self, int node, int word, double first, double second, double third) noexcept nogil
    cdef void consider(self, int node, double dx, double dy, double limit) noexcept nogil
    @cython.final
    cdef void consider_bucket(self, int row, int column) noexcept nogil
    @cython.final
    cdef void consider_all(self) noexcept nogil
    cdef void collect_nearest(self, double x, double y, double theta, int wanted, double within) noexcept nogil
    cdef void collect_useful(self, double x, double y, double theta, int wanted, double most_cost,
                             double within) noexcept nogil

cdef class ForwardNeighbors(BackwardNeighbors):
    cdef void collect_cheaper(self, int node, double neighbor_radius, double least_gain) noexcept nogil
