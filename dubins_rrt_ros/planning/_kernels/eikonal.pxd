cimport cython

cdef double FAR
cdef (double, double) squared_slopes(double here, double right, double above, double beyond) noexcept nogil

@cython.final
cdef class Eikonal:
    cdef int width, size
    cdef readonly signed char[::1] free
    cdef readonly double[::1] cost
    cdef double[::1] slowness
    cdef double[::1] gradient
    cdef double[::1] slope
    cdef signed char[::1] state
    cdef int[::1] queue
    cdef int[::1] later
    cdef int[::1] order
    cdef int[::1] rank
    cdef int first, waiting, postponed, ordered, last
    cdef double limit, until, least_fall, rise, target_column, target_row
    cdef bint has_target, has_gradients, has_slowness
    cdef void seed(self, double column, double row, double reach) noexcept nogil
    cdef double straight_on(self, int node) noexcept nogil
    cdef void ensure_final(self, int square) noexcept nogil
    cdef void flood_up_to(self, int square) noexcept nogil
    cdef bint is_final(self, int square) noexcept nogil
    cdef void flood(self) noexcept nogil
    cdef void pass_on(self, int node, int neighbour) noexcept nogil
    cdef void relax(self, int node, double cost) noexcept nogil
    cdef void raise_limit(self) noexcept nogil
    cdef void enqueue(self, int node) noexcept nogil
    cdef int dequeue(self) noexcept nogil
    cdef double update(self, int node, double gradient) noexcept nogil
    cdef void reduce_slopes(self) noexcept nogil
    cdef bint falls_behind(self, int neighbour, int node) noexcept nogil
    cdef void find_steepest(self, double[::1] steepest) noexcept nogil
    cdef void compress(self, double[::1] steepest, double[::1] heights) noexcept nogil
    cdef double steepest(self, int square) noexcept nogil
