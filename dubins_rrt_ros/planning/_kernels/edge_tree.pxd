cimport cython

@cython.final
cdef class EdgeTree:
    cdef double[:, ::1] edges
    cdef double[:, ::1] boxes
    cdef Py_ssize_t leaves, edges_per_leaf
    cdef double squared_distance(self, double x, double y) noexcept nogil
    cdef double nearest_in_leaf(self, Py_ssize_t leaf, double x, double y, double nearest) noexcept nogil
    cdef double squared_to_box(self, Py_ssize_t node, double x, double y) noexcept nogil
    cdef bint meets_sweep(self, double left, double low, double right, double high, double[:, ::1] corners, int first, int end,
                          double along, double across) noexcept nogil
