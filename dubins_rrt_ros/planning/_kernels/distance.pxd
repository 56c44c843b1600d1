cdef int left_gap(int row_gap) noexcept nogil
cdef int right_gap(int row_gap) noexcept nogil
cdef void envelope(int[::1] column, long long[::1] apex, long long[::1] height, long long[::1] begin) noexcept nogil
