cimport cython

@cython.final
cdef class Descent:
    cdef int width
    cdef signed char[::1] free
    cdef double[::1] from_start, to_goal
    cdef int[::1] nodes
    cdef int descend(self, double[::1] costs, int node, int[::1] owners, int count) noexcept nogil
    cdef bint is_joined(self, int node, int row, int column) noexcept nogil
