# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""A tree of boxes around the edges of polygons, for exact distances and contacts in time that hardly grows with their number.

It is a complete binary tree in one array: node i has the children 2 i and 2 i + 1, the root is node 1. The edges are in Morton
order of their middles, so that those of a leaf lie close together (G. M. Morton, A computer oriented geodetic data base, 1966).
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import UNLIMITED
else:
    from .dubins import UNLIMITED

#: Maximum number of edges in a leaf.
LEAF_EDGES = 4
#: Number of steps along each side of the square in which the Morton order is counted.
MORTON_STEPS = 1 << 16


@cython.cclass
class EdgeTree:
    """The edges of polygons, (m, 4): x, y, x, y of both ends."""

    def __init__(self, edges):
        """Sort the edges and put boxes around them."""
        leaves = 1
        while leaves * LEAF_EDGES < len(edges):
            leaves *= 2
        per_leaf = -(-len(edges) // leaves)
        order = np.resize(np.argsort(morton_codes(edges), kind="stable"), leaves * per_leaf)
        order[len(edges):] = order[len(edges) - 1]
        ordered = np.ascontiguousarray(edges[order])
        self.edges, self.boxes = ordered, boxes_around(ordered.reshape(leaves, per_leaf, 2, 2))
        self.leaves, self.edges_per_leaf = leaves, per_leaf

    def squared_distance(self, x, y):
        """Return the squared distance to the nearest edge."""
        node: cython.Py_ssize_t = 1
        while node < self.leaves:  # down to a leaf that is near, so that few others are left to look at
            node *= 2
            if self.squared_to_box(node + 1, x, y) < self.squared_to_box(node, x, y):
                node += 1
        nearest: cython.double = self.nearest_in_leaf(node, x, y, UNLIMITED)
        node = 1
        while node > 0:
            if self.squared_to_box(node, x, y) < nearest:
                if node < self.leaves:
                    node *= 2
                    continue
                nearest = self.nearest_in_leaf(node, x, y, nearest)
            node = after(node)
        return nearest

    def nearest_in_leaf(self, leaf, x, y, nearest):
        """Return the least of `nearest` and the squared distances to the edges of a leaf."""
        first: cython.Py_ssize_t = (leaf - self.leaves) * self.edges_per_leaf
        edge: cython.Py_ssize_t
        for edge in range(first, first + self.edges_per_leaf):
            nearest = min(nearest, squared_to_segment(x, y, self.edges, edge))
        return nearest

    def squared_to_box(self, node, x, y):
        """Return the squared distance to the box of a node, 0 within it."""
        dx: cython.double = max(max(self.boxes[node, 0] - x, x - self.boxes[node, 2]), 0.0)
        dy: cython.double = max(max(self.boxes[node, 1] - y, y - self.boxes[node, 3]), 0.0)
        return dx * dx + dy * dy

    def meets_sweep(self, left, low, right, high, corners, first, end, along, across):
        """Return whether a convex polygon that moves straight touches an edge that reaches into a box."""
        node: cython.Py_ssize_t = 1
        edge: cython.Py_ssize_t
        begin: cython.Py_ssize_t
        while node > 0:
            if (self.boxes[node, 0] <= right and self.boxes[node, 2] >= left
                    and self.boxes[node, 1] <= high and self.boxes[node, 3] >= low):
                if node < self.leaves:
                    node *= 2
                    continue
                begin = (node - self.leaves) * self.edges_per_leaf
                for edge in range(begin, begin + self.edges_per_leaf):
                    if sweep_meets_segment(corners, first, end, along, across, self.edges, edge):
                        return True
            node = after(node)
        return False


def morton_codes(edges):
    """Return (m,) int64: for the middle of each edge, the bits of its row and its column in turn."""
    middle = edges[:, :2] + edges[:, 2:]
    middle -= middle.min(axis=0)
    places = (middle * ((MORTON_STEPS - 1) / max(middle.max(), np.finfo(float).tiny))).astype(np.int64)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        places = (places | places << shift) & mask
    return places[:, 0] | places[:, 1] << 1


def boxes_around(points):
    """Return (2 n, 4): for (n, k, 2, 2) edges of n leaves, the least and the greatest x and y of each node of the tree."""
    leaves = len(points)
    boxes = np.zeros((2 * leaves, 4))
    boxes[leaves:, :2], boxes[leaves:, 2:] = points.min(axis=(1, 2)), points.max(axis=(1, 2))
    while leaves > 1:
        leaves //= 2
        children = boxes[2 * leaves:4 * leaves].reshape(leaves, 2, 4)
        boxes[leaves:2 * leaves, :2], boxes[leaves:2 * leaves, 2:] = children[..., :2].min(axis=1), children[..., 2:].max(axis=1)
    return boxes


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def after(node: cython.Py_ssize_t) -> cython.Py_ssize_t:
    """Return the node that comes after a node and all below it, depth first; 0 after the last."""
    while node & 1:
        node >>= 1
    return node + 1 if node > 0 else 0


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def sweep_meets_segment(corners: cython.double[:, ::1], first: cython.int, end: cython.int, along: cython.double,
                        across: cython.double, edges: cython.double[:, ::1], edge: cython.Py_ssize_t) -> cython.bint:
    """Return whether a convex polygon that moves straight touches an edge: no line along a side of either separates them."""
    before: cython.int = end - 1
    i: cython.int
    for i in range(first, end):
        if lies_beyond(corners[i, 1] - corners[before, 1], corners[before, 0] - corners[i, 0], corners, first, end, along, across,
                       edges, edge):
            return False
        before = i
    dx: cython.double = edges[edge, 2] - edges[edge, 0]
    dy: cython.double = edges[edge, 3] - edges[edge, 1]
    return not (lies_beyond(dy, -dx, corners, first, end, along, across, edges, edge)
                or lies_beyond(-dy, dx, corners, first, end, along, across, edges, edge)
                or lies_beyond(across, -along, corners, first, end, along, across, edges, edge)
                or lies_beyond(-across, along, corners, first, end, along, across, edges, edge))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def lies_beyond(normal_x: cython.double, normal_y: cython.double, corners: cython.double[:, ::1], first: cython.int,
                end: cython.int, along: cython.double, across: cython.double, edges: cython.double[:, ::1],
                edge: cython.Py_ssize_t) -> cython.bint:
    """Return whether an edge lies farther in a direction than a convex polygon that moves straight ever gets."""
    farthest: cython.double = -UNLIMITED
    i: cython.int
    for i in range(first, end):
        farthest = max(farthest, normal_x * corners[i, 0] + normal_y * corners[i, 1])
    farthest += max(0.0, normal_x * along + normal_y * across)
    return min(normal_x * edges[edge, 0] + normal_y * edges[edge, 1],
               normal_x * edges[edge, 2] + normal_y * edges[edge, 3]) > farthest


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def squared_to_segment(x: cython.double, y: cython.double, edges: cython.double[:, ::1], edge: cython.Py_ssize_t
                       ) -> cython.double:
    """Return the squared distance from a point to an edge."""
    dx: cython.double = edges[edge, 2] - edges[edge, 0]
    dy: cython.double = edges[edge, 3] - edges[edge, 1]
    px: cython.double = x - edges[edge, 0]
    py: cython.double = y - edges[edge, 1]
    along: cython.double = (px * dx + py * dy) / (dx * dx + dy * dy)
    along = min(max(along, 0.0), 1.0)
    px -= along * dx
    py -= along * dy
    return px * px + py * py
