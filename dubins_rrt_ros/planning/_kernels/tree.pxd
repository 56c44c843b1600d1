cimport cython
from dubins_rrt_ros.planning._kernels.dubins cimport Curve, Pose

@cython.final
cdef class SearchTree:
    cdef readonly int size
    cdef readonly int indexed
    cdef readonly double radius
    cdef readonly double rounding
    cdef readonly double[:, ::1] poses
    cdef double[:, ::1] headings
    cdef readonly int[::1] parents
    cdef readonly double[::1] costs
    cdef readonly double[::1] edge_costs
    cdef readonly signed char[::1] words
    cdef readonly double[:, ::1] lengths
    cdef int[::1] first_child
    cdef int[::1] next_sibling
    cdef int[::1] previous_sibling
    cdef int[::1] next_in_bucket
    cdef int[:, ::1] buckets
    cdef double x0
    cdef double y0
    cdef double bucket_size
    cdef double x_extent
    cdef double y_extent
    cdef Pose pose_of(self, int node) noexcept nogil
    cdef int add(self, Pose pose, int parent, Curve curve, double cost) noexcept nogil
    cdef void reparent(self, int node, int parent, Curve curve, double cost) noexcept nogil
    cdef void attach(self, int node, int parent, Curve curve, double cost) noexcept nogil
    cdef void update_costs_below(self, int root) noexcept nogil
    cdef void index(self, int node) noexcept nogil
    cdef int bucket_row(self, double y) noexcept nogil
    cdef int bucket_column(self, double x) noexcept nogil
