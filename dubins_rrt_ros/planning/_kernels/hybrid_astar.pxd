cimport cython
from dubins_rrt_ros.planning._kernels.closed_set cimport ClosedSet
from dubins_rrt_ros.planning._kernels.collision cimport CollisionChecker
from dubins_rrt_ros.planning._kernels.cost_to_go cimport CostToGoKernel
from dubins_rrt_ros.planning._kernels.dubins cimport Curve, Pose
from dubins_rrt_ros.planning._kernels.edge_cost cimport EdgeCost
from dubins_rrt_ros.planning._kernels.heap cimport Heap

@cython.final
cdef class HybridAStar:
    cdef CollisionChecker checker
    cdef EdgeCost edge_cost
    cdef double radius
    cdef CostToGoKernel to_goal
    cdef double[:, ::1] goals
    cdef double[:, ::1] goal_headings
    cdef double rounding
    cdef double arc
    cdef double turning_arc
    cdef double weight
    cdef double visit_penalty
    cdef double limit
    cdef double good_enough
    cdef int max_expanded
    cdef readonly int size
    cdef readonly int expanded
    cdef readonly bint ended
    cdef bint done
    cdef double[:, ::1] poses
    cdef double[::1] costs
    cdef int[::1] parents
    cdef signed char[::1] turns
    cdef double[::1] arcs
    cdef double[::1] keys
    cdef signed char[::1] tried
    cdef double[::1] arc_factors
    cdef int next_factor
    cdef double retry_penalty
    cdef signed char[::1] curve_may_be_free
    cdef ClosedSet closed_set
    cdef ClosedSet visits_near
    cdef Heap open
    cdef int last
    cdef int last_goal
    cdef Curve last_curve
    cdef Pose pose_of(self, int node) noexcept nogil
    cdef void expand(self, int node) noexcept nogil
    cdef void try_curve_to_goal(self, int node) noexcept nogil
    cdef void extend(self, int node, double sine, double cosine, int turn) noexcept nogil
    cdef double next_arc(self, int turn) noexcept nogil
    cdef (double, bint) cost_to_go(self, Pose pose, double limit) noexcept nogil
    cdef Curve curve_to_goal(self, Pose pose, int goal, double limit) noexcept nogil
    cdef void add(self, Pose pose, double cost, int parent, int turn, double arc, double key,
                  bint curve_may_be_free) noexcept nogil
