cdef struct Pose:
    double x
    double y
    double theta

cdef struct Curve:
    int word
    double first
    double second
    double third

cdef double TWO_PI
cdef double UNLIMITED
cdef double length_of(Curve curve) noexcept nogil
cdef double arc_length(Curve curve, int arc) noexcept nogil
cdef int turn_of(int word, int arc) noexcept nogil
cdef Curve single_arc(int turn, double length) noexcept nogil
cdef Curve first_part(Curve curve, double length) noexcept nogil
cdef Curve part_of(Curve curve, double begin, double end) noexcept nogil
cdef double fastest_point(double[:, ::1] points, double radius, int turn) noexcept nogil
cdef Pose drive(Pose pose, double radius, int turn, double s) noexcept nogil
cdef Pose drive_from(Pose pose, double sin_theta, double cos_theta, double radius, int turn, double s) noexcept nogil
cdef Pose end_of(Pose pose, double radius, Curve curve) noexcept nogil
cdef Pose along(Pose pose, double radius, Curve curve, double s) noexcept nogil
cdef Curve shortest_within(double dx, double dy, double theta0, double sin0, double cos0, double theta1, double sin1, double cos1,
                           double radius, double rounding, double limit) noexcept nogil
cdef Curve shortest(Pose start, Pose goal, double radius) noexcept nogil
cdef Curve shortest_below(Pose start, Pose goal, double radius, double rounding, double limit) noexcept nogil
cpdef double rounding_at(double x, double y) noexcept nogil
