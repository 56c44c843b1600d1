"""The search tree as a result: arrays, apart from those of the search."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._kernels.tree import SearchTree
from ..collision.clearance import ClearanceField
from ..curves.angles import heading_error, position_error
from ..curves.dubins import TURNS, DubinsCurve, poses_on
from ..curves.path import Path
from ..errors import PlanningError
from ..pictures import Plottable, check_matplotlib
from ..problem import Pose
from ..vehicle import Vehicle
from .cost import lengths_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Maximum error of the end of an edge, in metres for each metre and in radians, and of a coordinate, relatively.
TOLERANCE, ROUNDING = 1e-9, 4e-15


class TreeError(PlanningError, AssertionError):
    """A tree that breaks one of its invariants; the message says which and where."""


@dataclass(frozen=True, eq=False)
class Tree(Plottable):
    """Nodes and the edges from their parents. Node 0 is the start.

    Attributes:
        radius: turning radius of all edges [m].
        poses: (n, 3) float64: x [m], y [m], theta [rad].
        parents: (n,) int32; the start's is -1.
        costs: (n,) float64: costs of the paths from the start [m].
        words: (n,) int8, indices into WORDS; an edge is driven from the parent's pose.
        lengths: (n, 3) float64: lengths of the three arcs of each edge [m].
        edge_costs: (n,) float64: costs of the edges [m]; their lengths where that is what was minimised.
    """

    radius: float
    poses: np.ndarray
    parents: np.ndarray
    costs: np.ndarray
    words: np.ndarray
    lengths: np.ndarray
    edge_costs: np.ndarray

    def __repr__(self) -> str:
        return f"Tree({len(self)} node{'' if len(self) == 1 else 's'}, radius={self.radius:g})"

    @classmethod
    def copy_of(cls, tree: SearchTree) -> "Tree":
        """Copy the tree of a search under way."""
        arrays = (np.array(view[:tree.size])
                  for view in (tree.poses, tree.parents, tree.costs, tree.words, tree.lengths, tree.edge_costs))
        return cls(tree.radius, *arrays)

    @classmethod
    def of_root(cls, root: Pose, radius: float) -> "Tree":
        """Return a tree of its root alone."""
        return cls(radius, np.array([root]), np.array([-1], np.int32), np.zeros(1), np.zeros(1, np.int8), np.zeros((1, 3)),
                   np.zeros(1))

    @classmethod
    def of_path(cls, path: Path, edge_costs: np.ndarray) -> "Tree":
        """Return the tree of a path alone, given the (n,) costs of its curves."""
        edge_costs = np.append(0.0, edge_costs)
        parents = np.arange(-1, len(edge_costs) - 1, dtype=np.int32)
        return cls(path.radius, path.waypoints, parents, np.cumsum(edge_costs), path.words, path.lengths, edge_costs)

    def after(self, path: Path, edge_costs: np.ndarray) -> "Tree":
        """Return the tree with a path in front of it, which leads to its root, given the (n,) costs of the path's curves."""
        before = len(path.words) - 1
        parents = np.append(np.arange(-1, before), np.where(self.parents[1:] < 0, -1, self.parents[1:] + before)).astype(np.int32)
        poses, words, lengths = (np.concatenate([ahead, own[1:]]) for ahead, own in (
            (path.waypoints, self.poses), (path.words, self.words), (path.lengths, self.lengths)))
        edge_costs = np.concatenate([[0.0], edge_costs, self.edge_costs[1:]])
        return Tree(self.radius, poses, parents, _costs(parents, edge_costs), words, lengths, edge_costs)

    def __len__(self) -> int:
        return len(self.parents)

    def curve_to(self, node: int) -> DubinsCurve:
        """Return the edge from the parent of `node`."""
        return DubinsCurve.of_row(self.poses[self.parents[node]], self.radius, self.words[node], self.lengths[node])

    def path_to(self, node: int) -> Path:
        """Return the path from the start to `node`."""
        return path_to(node, self)

    def with_path(self, path: Path, edge_costs: np.ndarray) -> "Tree":
        """Return the tree with a path from its root as a branch of its own, given the (n,) costs of the path's curves."""
        new, first = len(path.words) - 1, len(self)
        parents = np.arange(first - 1, first + new - 1, dtype=np.int32)
        parents[:1] = 0
        added = path.waypoints[1:], parents, np.cumsum(edge_costs), path.words[1:], path.lengths[1:], edge_costs
        arrays = self.poses, self.parents, self.costs, self.words, self.lengths, self.edge_costs
        return Tree(self.radius, *(np.concatenate(both) for both in zip(arrays, added, strict=True)))

    def segments(self, spacing: float, most: int | None = None) -> np.ndarray:
        """Return (m, 2, 2) float64 ends (x, y) [m] of straight pieces that draw all edges, turns in pieces of `spacing` [m].

        At most the first `most` pieces, which lead to the oldest nodes.
        """
        pieces = np.where(TURNS[self.words], np.ceil(self.lengths / spacing), self.lengths > 0).astype(np.int64).ravel()
        arc = np.repeat(np.arange(len(pieces)), pieces)[:most]
        nth = np.arange(len(arc)) - (np.cumsum(pieces) - pieces)[arc]
        begins = (np.cumsum(self.lengths, axis=1) - self.lengths).ravel()
        piece = self.lengths.ravel()[arc] / pieces[arc]
        nodes = arc // 3
        ends = [poses_on(self.poses, self.words, self.lengths, self.radius, self.parents[nodes], nodes,
                         begins[arc] + (nth + end) * piece)[:, :2] for end in (0, 1)]
        return np.stack(ends, axis=1)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw all edges, on axes or in a new pyplot figure, and return the axes.

        Raises:
            PictureError: matplotlib is not installed.
        """
        check_matplotlib()
        from ..pictures.plots import plot_tree
        return plot_tree(self, ax)

    def check(self, field: ClearanceField | None = None, vehicle: Vehicle | None = None) -> None:
        """Check the invariants; with a field and a vehicle also that this touches no obstacle along any edge.

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
        wrong = np.flatnonzero(self.costs[1:] != self.costs[parents[1:]] + self.edge_costs[1:]) + 1
        if len(wrong):
            raise TreeError(f"the cost of node {wrong[0]} is not its parent's and that of its edge")
        wrong = np.flatnonzero(self.edge_costs[1:] < lengths_of(self.lengths[1:])) + 1
        if len(wrong):
            raise TreeError(f"the edge to node {wrong[0]} costs less than its length")
        for node in range(1, n):
            self._check_edge(node, field, vehicle)

    def _check_edge(self, node: int, field: ClearanceField | None, vehicle: Vehicle | None) -> None:
        curve = self.curve_to(node)
        end, pose = curve.end, tuple(self.poses[node].tolist())
        rounding = ROUNDING * max(map(abs, (*curve.start[:2], *pose[:2])))
        if not (position_error(end, pose) <= TOLERANCE * (1 + curve.length) + rounding
                and heading_error(end, pose) <= TOLERANCE + rounding / self.radius):
            raise TreeError(f"the edge to node {node} ends at {end}, not at {pose}")
        if field and vehicle and not field.curve_is_free(curve, vehicle):
            raise TreeError(f"the edge to node {node} is not free for {vehicle}")


def _costs(parents: np.ndarray, edge_costs: np.ndarray) -> np.ndarray:
    """Return the (n,) costs of nodes, each its parent's and that of its edge."""
    costs = np.zeros(len(parents))
    known = parents < 0
    while not known.all():
        new = ~known & known[parents]
        costs[new] = costs[parents[new]] + edge_costs[new]
        known |= new
    return costs


def path_to(node: int, tree: Tree | SearchTree) -> Path:
    """Return the path from the start to a node; nothing else of the tree is copied."""
    nodes = []
    while node >= 0:
        nodes.append(node)
        node = tree.parents[node]
    nodes.reverse()
    poses, words, lengths = (np.asarray(array)[nodes] for array in (tree.poses, tree.words, tree.lengths))
    return Path(poses, words, lengths, tree.radius)
