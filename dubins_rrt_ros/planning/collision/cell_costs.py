"""The costs of a grid's cells, as the kernels and the cost-to-go take them."""

import math
from functools import cached_property

import numpy as np
from scipy import ndimage

from .._kernels.cell_costs import CellCosts
from ..maps.model import GridMap

#: Greatest number of cells that is noted.
FARTHEST = 255


class CostCells:
    """The cells of a grid, where some of them have costs."""

    def __init__(self, grid: GridMap, costs: np.ndarray, allow_unknown: bool):
        self._costs, self._blocked = costs, grid.blocked(allow_unknown)
        self._resolution, self._origin = grid.resolution, grid.origin

    @classmethod
    def of(cls, grid: GridMap, allow_unknown: bool) -> "CostCells | None":
        """Return the cells of a grid; None where no cell has a cost."""
        return None if grid.costs is None else cls(grid, grid.costs, allow_unknown)

    def kernel(self) -> CellCosts:
        """Return the costs along arcs, for one thread."""
        return CellCosts(self._costs, self._free_of_cost, self._resolution, self._origin)

    @cached_property
    def _free_of_cost(self) -> np.ndarray:
        return cells_to_cost(self._costs)

    def of_squares(self, side: int, is_bound: bool) -> np.ndarray:
        """Return what `costs_of_squares` does for squares of `side` x `side` cells."""
        return costs_of_squares(self._costs, self._blocked, side, is_bound)


def cells_to_cost(costs: np.ndarray) -> np.ndarray:
    """Return (rows, columns) uint8: the number of columns or rows from each cell to the nearest one with a cost, up to 255."""
    away: np.ndarray = np.asarray(ndimage.distance_transform_cdt(costs == 0, metric="chessboard"))
    return np.asarray(np.minimum(away, FARTHEST), np.uint8)


def costs_of_squares(costs: np.ndarray, blocked: np.ndarray, side: int, is_bound: bool) -> np.ndarray:
    """Return the costs of squares as shares of 100 %: the least of their cells that are free, or the mean of these.

    Args:
        costs, blocked: (rows, columns): of the cells [%], and which of them no path leads over.
        side: the side of a square in cells; the last squares of a row or a column may reach beyond the grid.
        is_bound: True for the least, False for the mean.

    Returns:
        (rows, columns) of squares; 0 where no cell is free.
    """
    shares = np.where(blocked, np.nan, costs / 100.0)
    rows, columns = (math.ceil(cells / side) for cells in costs.shape)
    padded = np.pad(shares, [(0, count * side - cells) for count, cells in zip((rows, columns), costs.shape, strict=True)],
                    constant_values=np.nan)
    blocks = padded.reshape(rows, side, columns, side)
    least = np.where(np.isnan(blocks), np.inf, blocks).min(axis=(1, 3)) if is_bound else _mean(blocks)
    return np.asarray(np.where(np.isfinite(least), least, 0.0))


def _mean(blocks: np.ndarray) -> np.ndarray:
    """Return the means over the second and the last axis of what is no NaN."""
    known = ~np.isnan(blocks)
    return np.asarray(np.where(known, blocks, 0.0).sum(axis=(1, 3)) / np.maximum(known.sum(axis=(1, 3)), 1))
