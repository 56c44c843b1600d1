cimport cython
from dubins_rrt_ros.planning._kernels.collision cimport CollisionChecker
from dubins_rrt_ros.planning._kernels.cost_to_go cimport CostToGoKernel
from dubins_rrt_ros.planning._kernels.dubins cimport Curve, Pose
from dubins_rrt_ros.planning._kernels.edge_cost cimport EdgeCost
from dubins_rrt_ros.planning._kernels.near cimport BackwardNeighbors, ForwardNeighbors
from dubins_rrt_ros.planning._kernels.tree cimport SearchTree

@cython.final
cdef class RrtKernel:
    cdef SearchTree tree
    cdef CollisionChecker checker
    cdef EdgeCost edge_cost
    cdef double step
    cdef double max_edge
    cdef double near_factor
    cdef Pose goal
    cdef double tolerance_xy
    cdef double tolerance_yaw
    cdef BackwardNeighbors closest
    cdef BackwardNeighbors backward
    cdef ForwardNeighbors forward
    cdef Pose new_pose
    cdef Curve steered
    cdef bint bounded
    cdef int tried
    cdef double cost_bound
    cdef CostToGoKernel from_start
    cdef CostToGoKernel to_goal
    cdef int[::1] goal_nodes
    cdef readonly int goal_count
    cdef void extend(self, Pose sample) noexcept nogil
    cdef void extend_and_rewire(self, Pose pose) noexcept nogil
    cdef int near_count(self) noexcept nogil
    cdef double cost_to_go(self, Pose pose) noexcept nogil
    cdef double cost_to_come(self, Pose pose) noexcept nogil
    cdef bint steer(self, Pose sample) noexcept nogil
    cdef int choose_parent(self, Pose pose, int node, double limit) noexcept nogil
    cdef void rewire(self, int node, double radius) noexcept nogil
    cdef double cost_if_free(self, Pose pose, Curve curve, double limit) noexcept nogil
    cdef int add(self, Pose pose, int parent, Curve curve, double cost) noexcept nogil
