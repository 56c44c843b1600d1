cimport cython
from dubins_rrt_ros.planning._kernels.collision cimport CollisionChecker
from dubins_rrt_ros.planning._kernels.dubins cimport Curve, Pose
from dubins_rrt_ros.planning._kernels.edge_cost cimport EdgeCost

@cython.final
cdef class Shortcutter:
    cdef CollisionChecker checker
    cdef EdgeCost edge_cost
    cdef double price
    cdef double radius
    cdef double scale
    cdef readonly int count
    cdef readonly double[:, ::1] poses
    cdef readonly signed char[::1] words
    cdef readonly double[:, ::1] lengths
    cdef readonly double[::1] ends
    cdef double[::1] costs
    cdef double[::1] excess
    # A change under way: `new` poses behind the pose `left`, the first `kept` of which lie on the path; it leads from `begin` `at`.
    cdef int left
    cdef int kept
    cdef int new
    cdef Pose begin
    cdef Pose at
    cdef double[:, ::1] new_poses
    cdef signed char[::1] new_words
    cdef double[:, ::1] new_lengths
    cdef double[::1] new_costs
    cdef double rest_cost
    # The pose from which the first clearing goes on.
    cdef int clearing
    cdef void try_change(self, bint direct, double where, double back, double ahead, double across, double turn) noexcept nogil
    cdef void try_shortcut(self, double begin, double end) noexcept nogil
    cdef void try_perturbation(self, double begin, double middle, double end, double fine, double across,
                               double turn) noexcept nogil
    cdef void leave(self, double s) noexcept nogil
    cdef void leave_pose(self, int pose, Pose at) noexcept nogil
    cdef bint drive_to(self, Pose target, double limit) noexcept nogil
    cdef void append(self, Pose pose, Curve curve) noexcept nogil
    cdef Curve new_curve(self, int i) noexcept nogil
    cdef Curve curve_to(self, int pose) noexcept nogil
    cdef Pose pose_of(self, int pose) noexcept nogil
    cdef Pose pose_of_new(self, int i) noexcept nogil
    cdef bint new_is_free(self) noexcept nogil
    cdef double excess_between(self, double begin, double end) noexcept nogil
    cdef bint pays(self, double s, double least_gain) noexcept nogil
    cdef Curve rest_of(self, int edge, double s) noexcept nogil
    cdef bint is_free(self, Pose pose, Curve curve) noexcept nogil
    cdef void come_back(self, double s) noexcept nogil
    cdef void put_in(self, int tail) noexcept nogil
    cdef void clear(self) noexcept nogil
    cdef void clear_some(self, int checks) noexcept nogil
    cdef void move_tail(self, int begin, int to) noexcept nogil
    cdef void copy(self, int pose, int to) noexcept nogil
    cdef void measure_from(self, int first) noexcept nogil
    cdef int edge_at(self, double s) noexcept nogil
    cdef Pose pose_at(self, double s) noexcept nogil
