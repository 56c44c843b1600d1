cimport cython

cdef float UNSEEN

@cython.final
cdef class ClosedSet:
    cdef int used
    cdef int bits
    cdef int sectors
    cdef long long columns
    cdef long long rows
    cdef double side
    cdef double circles_per_radian
    cdef double x0
    cdef double y0
    cdef long long[::1] cells
    cdef float[::1] costs
    cdef int entry_at(self, double x, double y, double theta) noexcept nogil
    cdef int entry_of(self, long long cell) noexcept nogil
