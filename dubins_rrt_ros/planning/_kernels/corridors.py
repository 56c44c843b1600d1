# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Corridors between two points: the ways around obstacles that are shortest among those near to them.

Over each place leads a shortest way from the start to the goal; its length is a function of the place. Where the length is below
a limit lie the corridors that matter; the rest, obstacles included, falls into regions, and the paths of two corridors pass
between different ones. As the limit rises these regions shrink, and where a neck between two of them breaks, at a saddle of the
lengths, another corridor opens: the shortest way over the saddle. So all corridors are found as saddles, by a union of regions
from the greatest length down (the merge tree of the lengths: H. Carr, J. Snoeyink and U. Axen, Computing contour trees in all
dimensions, 2003).
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.eikonal import FAR
else:
    from .eikonal import FAR


def saddles(lengths: cython.double[::1], width: cython.int, limit: cython.double):
    """Find where regions around different obstacles meet.

    Args:
        lengths: (rows * width,) lengths of the shortest ways over squares [m], 1e300 for obstacles; all squares at the edges are.
        width: number of squares in a row.
        limit: length that a way must be below [m].

    Returns:
        (n,) int32 squares, the one over which the shortest way leads first.
    """
    size: cython.int = lengths.shape[0]
    below = np.flatnonzero(np.asarray(lengths) < limit).astype(np.int32)
    order: cython.int[::1] = below[np.argsort(-np.asarray(lengths)[below], kind="stable")]
    parents: cython.int[::1] = np.full(size, -1, np.int32)
    found: cython.int[::1] = np.empty(len(below), np.int32)
    count: cython.int = 0
    square: cython.int
    i: cython.int
    with cython.nogil:
        for square in range(size):
            if lengths[square] >= limit:
                parents[square] = square
                if square > 0:
                    join(parents, lengths, square, square - 1)
                if square >= width:
                    join(parents, lengths, square, square - width)
        for i in range(order.shape[0]):
            square = order[i]
            parents[square] = square
            if (join(parents, lengths, square, square - 1) + join(parents, lengths, square, square + 1)
                    + join(parents, lengths, square, square - width) + join(parents, lengths, square, square + width)) > 0:
                found[count] = square
                count += 1
    return np.asarray(found)[:count][::-1].copy()


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def join(parents: cython.int[::1], lengths: cython.double[::1], square: cython.int, other: cython.int) -> cython.bint:
    """Join the regions of two squares, if the other one is in a region; return whether that joins two obstacles.

    A region's root is an obstacle's square, where it has one.
    """
    if parents[other] < 0:
        return False
    root: cython.int = find(parents, square)
    other = find(parents, other)
    if root == other:
        return False
    if lengths[root] < FAR:
        parents[root] = other
        return False
    parents[other] = root
    return lengths[other] >= FAR


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def find(parents: cython.int[::1], square: cython.int) -> cython.int:
    """Return the root of a square's region, and halve the way to it."""
    while parents[square] != square:
        parents[square] = parents[parents[square]]
        square = parents[square]
    return square


@cython.cclass
class Descent:
    """Ways down the costs from the start and to the goal, up to where they meet a path.

    Square s has the nodes s, s + 1, s + width and s + width + 1; a step leads to the cheapest neighbour, along an edge or a
    diagonal of a free square.
    """

    def __init__(self, free, from_start, to_goal):
        """Take (rows, columns) int8, not 0 for each free square, and the costs of the nodes [m], of the same shape."""
        self.width = free.shape[1]
        self.free, self.from_start, self.to_goal = free.reshape(-1), from_start.reshape(-1), to_goal.reshape(-1)
        self.nodes = np.empty(2 * free.size, np.int32)  # for two ways, on each of which the costs fall

    def measure(self, seeds: cython.int[::1], owners: cython.int[::1], covered: cython.schar[::1]):
        """Measure the ways over seeds.

        Args:
            seeds: (n,) nodes.
            owners: number of a path's piece near a node, or -1, for each node.
            covered: not 0 for each node where ways are not of interest.

        Returns:
            (n, 2) int32 pieces that the ways leave and come back to, -1 where they do neither; (n,) lengths of the ways between,
            by the costs [m]; (n,) shares of the nodes on them that are not covered.
        """
        ends: cython.int[:, ::1] = np.full((len(seeds), 2), -1, np.int32)
        lengths: cython.double[::1] = np.zeros(len(seeds))
        new: cython.double[::1] = np.zeros(len(seeds))
        i: cython.int
        j: cython.int
        back: cython.int
        count: cython.int
        with cython.nogil:
            for i in range(seeds.shape[0]):
                if owners[seeds[i]] >= 0:
                    continue
                back = self.descend(self.from_start, seeds[i], owners, 0)
                count = self.descend(self.to_goal, seeds[i], owners, back)
                ends[i, 0], ends[i, 1] = owners[self.nodes[back - 1]], owners[self.nodes[count - 1]]
                lengths[i] = (self.from_start[seeds[i]] - self.from_start[self.nodes[back - 1]]
                              + self.to_goal[seeds[i]] - self.to_goal[self.nodes[count - 1]])
                for j in range(count):
                    new[i] += (1.0 if covered[self.nodes[j]] == 0 else 0.0) / count
        return np.asarray(ends), np.asarray(lengths), np.asarray(new)

    def way(self, seed: cython.int, owners: cython.int[::1]):
        """Return the (n,) int32 nodes of the way over a seed, from piece to piece."""
        back: cython.int = self.descend(self.from_start, seed, owners, 0)
        count: cython.int = self.descend(self.to_goal, seed, owners, back)
        nodes = np.asarray(self.nodes)
        return np.concatenate([nodes[:back][::-1], nodes[back + 1:count]])

    def descend(self, costs: cython.double[::1], node, owners: cython.int[::1], count):
        """Write the nodes from `node` on down the costs to `nodes`, from index `count` on; return the index behind the last."""
        column: cython.int
        row: cython.int
        beyond: cython.int
        best: cython.int = node
        while True:
            self.nodes[count] = node
            count += 1
            if owners[node] >= 0:
                return count
            for row in range(-1, 2):
                for column in range(-1, 2):
                    beyond = node + row * self.width + column
                    if costs[beyond] < costs[best] and self.is_joined(node, row, column):
                        best = beyond
            if best == node:
                return count
            node = best

    def is_joined(self, node, row, column):
        """Return whether a node and its neighbour so many rows and columns on are nodes of the same free square."""
        right: cython.bint = column >= 0
        left: cython.bint = column <= 0
        if row >= 0 and ((right and self.free[node]) or (left and self.free[node - 1])):
            return True
        return row <= 0 and ((right and self.free[node - self.width]) or (left and self.free[node - self.width - 1]))
