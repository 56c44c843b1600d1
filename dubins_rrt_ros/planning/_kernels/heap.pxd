cimport cython

@cython.final
cdef class Heap:
    cdef int count
    cdef int[::1] items
    cdef double[::1] keys
    cdef double least_key(self) noexcept nogil
    cdef void push(self, int item, double key) noexcept nogil
    cdef int pop(self) noexcept nogil
