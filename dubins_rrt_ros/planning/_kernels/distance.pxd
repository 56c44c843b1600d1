cdef void envelope(int[::1] column, long long[::1] apex, long long[::1] height, long long[::1] begin) noexcept nogil
