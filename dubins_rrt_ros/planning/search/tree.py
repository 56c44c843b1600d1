"""The search tree as it is handed out: a structure of arrays, apart from the one that the planner grows."""

import math
from dataclasses import dataclass

import numpy as np

from .._kernels import dubins as _dubins
from .._kernels.tree import SearchTree
from ..collision.clearance import ClearanceField
from ..curves.dubins import WORDS, DubinsCurve
from ..curves.path import Path
from ..errors import PlanningError
from ..problem import Pose
from ..vehicle import Vehicle


class TreeError(PlanningError, AssertionError):
    """A tree that breaks one of its invariants; the message says which and where."""


@dataclass(frozen=True, eq=False)
class Tree:
    """Nodes and the edges from their parents. Node 0 is the start.

    Attributes:
        radius: the turning radius of all edges [m].
        poses: (n, 3) float64: x [m], y [m], theta [rad].
        parents: (n,) int32; the start's is -1.
        costs: (n,) float64: the length of the path from the start [m].
        words: (n,) int8, indices into WORDS; an edge is driven from the parent's pose.
        lengths: (n, 3) float64: of the three arcs of each edge [m].
    """

    radius: float
    poses: np.ndarray
    parents: np.ndarray
    costs: np.ndarray
    words: np.ndarray
    lengths: np.ndarray

    @classmethod
    def copy_of(cls, tree: SearchTree) -> "Tree":
        """Copy the tree of a search under way."""
        arrays = (np.array(view[:tree.size]) for view in (tree.poses, tree.parents, tree.costs, tree.words, tree.lengths))
        return cls(tree.radius, *arrays)

    @classmethod
    def of_root(cls, root: Pose, radius: float) -> "Tree":
        """Return a tree of its root alone."""
        return cls(radius, np.array([root]), np.array([-1], np.int32), np.zeros(1), np.zeros(1, np.int8), np.zeros((1, 3)))

    def __len__(self) -> int:
        return len(self.parents)

    def curve_to(self, node: int) -> DubinsCurve:
        """Return the edge from the parent of `node`."""
        start = tuple(self.poses[self.parents[node]].tolist())
        return DubinsCurve(start, self.radius, WORDS[self.words[node]], tuple(self.lengths[node].tolist()))

    def path_to(self, node: int) -> Path:
        """Return the path from the start to `node`."""
        return path_to(node, self)

    def segments(self, spacing: float, most: int | None = None) -> np.ndarray:
        """(m, 2, 2) float64: ends (x, y) [m] of the straight pieces that draw all edges; turns in pieces of `spacing` [m].

        No more than the first `most`, which lead to the oldest nodes.
        """
        turning = np.array([[turn != "S" for turn in word] for word in WORDS])[self.words]
        pieces = np.where(turning, np.ceil(self.lengths / spacing), self.lengths > 0).astype(np.int64).ravel()
        arc = np.repeat(np.arange(len(pieces)), pieces)[:most]
        nth = np.arange(len(arc)) - (np.cumsum(pieces) - pieces)[arc]
        begins = (np.cumsum(self.lengths, axis=1) - self.lengths).ravel()
        piece = self.lengths.ravel()[arc] / pieces[arc]
        out, poses, nodes = np.empty((len(arc), 2, 2)), np.empty((len(arc), 3)), arc // 3
        for end in (0, 1):
            _dubins.path_poses(self.poses, self.words, self.lengths, self.radius, self.parents[nodes].astype(nodes.dtype), nodes,
                               begins[arc] + (nth + end) * piece, poses)
            out[:, end] = poses[:, :2]
        return out

    def check(self, field: ClearanceField | None = None, vehicle: Vehicle | None = None) -> None:
        """Check the invariants, and where a field and a vehicle are given that it touches no obstacle along any edge.

        Raises:
            TreeError: one does not hold.
        """
        parents, n = self.parents, len(self)
        if n == 0 or parents[0] != -1 or self.costs[0] != 0:
            raise TreeError("node 0 is no root of cost 0")
        if n > 1 and not ((parents[1:] >= 0) & (parents[1:] < n)).all():
            raise TreeError("a parent is no node")
        ancestor = parents.copy()
        for _ in range(n.bit_length()):
            ancestor = np.where(ancestor >= 0, ancestor[ancestor], -1)
        if (ancestor >= 0).any():
            raise TreeError(f"node {int(np.argmax(ancestor >= 0))} is below a cycle")
        if not (self.lengths >= 0).all():
            raise TreeError(f"node {int(np.argmin((self.lengths >= 0).all(axis=1)))} has an arc that is not at least 0 long")
        edges = self.lengths[1:, 0] + self.lengths[1:, 1] + self.lengths[1:, 2]
        wrong = np.flatnonzero(self.costs[1:] != self.costs[parents[1:]] + edges) + 1
        if len(wrong):
            raise TreeError(f"the cost of node {wrong[0]} is not its parent's and the length of its edge")
        for node in range(1, n):
            self._check_edge(node, field, vehicle)

    def _check_edge(self, node: int, field: ClearanceField | None, vehicle: Vehicle | None) -> None:
        curve = self.curve_to(node)
        x, y, theta = self.poses[node]
        end = curve.end
        off, turned = math.hypot(end[0] - x, end[1] - y), abs(math.remainder(end[2] - theta, math.tau))
        if not (off <= 1e-9 * (1 + curve.length) and turned <= 1e-9):
            raise TreeError(f"the edge to node {node} ends at {end}, not at ({x}, {y}, {theta})")
        if field and vehicle and not field.curve_is_free(curve, vehicle):
            raise TreeError(f"the edge to node {node} is not free for {vehicle}")


def path_to(node: int, tree: Tree | SearchTree) -> Path:
    """Return the path from the start to a node; nothing else of the tree is copied."""
    nodes = []
    while node >= 0:
        nodes.append(node)
        node = tree.parents[node]
    nodes.reverse()
    poses, words, lengths = (np.asarray(array)[nodes] for array in (tree.poses, tree.words, tree.lengths))
    return Path(poses, words, lengths, tree.radius)
