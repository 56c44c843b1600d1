cdef double TWO_PI
cdef double NO_CURVE
cdef int turn_of(int word, int arc) noexcept nogil
cdef (double, double, double) drive(double x, double y, double theta, double radius, int turn, double s) noexcept nogil
cdef (double, double, double) drive_from(double x, double y, double theta, double sin_theta, double cos_theta, double radius,
                                         int turn, double s) noexcept nogil
cdef (int, double, double, double) shortest_within(double dx, double dy, double theta0, double sin0, double cos0,
                                                   double theta1, double sin1, double cos1, double radius,
                                                   double rounding, double limit) noexcept nogil
cpdef double rounding_at(double x, double y) noexcept nogil
cdef (int, double, double, double) shortest(double x0, double y0, double theta0, double x1, double y1, double theta1,
                                            double radius) noexcept nogil
