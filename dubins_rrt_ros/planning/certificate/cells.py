"""Cells: the connected components of a corridor's squares within a slab, between one level of the costs and the next."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...checker.levels import Squares


class Cells:
    """The cells of a corridor.

    Attributes:
        labels: (m,) cells of the slabs of squares, square after square, from the lowest slab to the highest.
        counts: (n,) numbers of slabs of each square.
    """

    def __init__(self, squares: Squares, corridor: np.ndarray):
        """Find them.

        Args:
            corridor: (n,) ascending indices of squares.
        """
        corners = squares.corners(corridor)
        lowest = squares.slabs(corners.min(axis=(1, 2)))
        self.counts = squares.slabs(corners.max(axis=(1, 2))) - lowest + 1
        size = (squares.costs.shape[0] - 1) * squares.columns
        self._corridor = corridor
        self._offset = np.zeros(size, int)
        self._offset[corridor] = np.cumsum(self.counts) - self.counts - lowest
        joined = []
        for one, other, low, high in squares.neighbours(corridor):
            counts = high - low + 1
            slab = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts - low, counts)
            joined.append(np.stack([self._part(np.repeat(one, counts), slab), self._part(np.repeat(other, counts), slab)]))
        ends = np.concatenate(joined, axis=1)
        parts = int(self.counts.sum())
        graph = coo_array((np.ones(ends.shape[1]), tuple(ends)), shape=(parts, parts))
        self.labels = connected_components(graph, directed=False)[1]

    def _part(self, squares: np.ndarray | int, slabs: np.ndarray) -> np.ndarray:
        return np.asarray(self._offset[squares] + slabs)

    def at(self, squares: np.ndarray | int, slabs: np.ndarray) -> np.ndarray:
        """Return the cells of squares within slabs."""
        return np.asarray(self.labels[self._part(squares, slabs)])

    def of(self, squares: np.ndarray) -> set[int]:
        """Return all cells that have a part in some of the corridor's squares."""
        parts = np.repeat(np.isin(self._corridor, squares), self.counts)
        return {int(cell) for cell in self.labels[parts]}

    def of_squares(self) -> list[list[int]]:
        """Return all cells of each of the corridor's squares."""
        return [part.tolist() for part in np.split(self.labels, np.cumsum(self.counts)[:-1])]
