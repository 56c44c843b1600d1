"""The cells of a grid: whole percent, and what may be meant otherwise is refused."""

import warnings
from typing import Any

import numpy as np

from .errors import MapError

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
#: Highest value of a grid [%] from which it is taken for percent without a doubt.
LEAST_PERCENT = 10


class DoubtfulGrid(UserWarning):
    """A warning: a grid whose values are taken for percent, but may be numbers for kinds of cells."""


def checked_cells(data: Any, name: str) -> np.ndarray:
    """Return a copy of cells as (rows, columns) int8: Booleans as free and occupied, whole numbers from -1 to 100 as they are.

    Args:
        name: where they came from, for messages.

    Raises:
        MapError: they are something else.
    """
    if np.ma.is_masked(data):
        raise MapError(f"{name}: cells are masked; give the values that they stand for, such as data.filled(-1)")
    try:
        cells = np.array(data, order="C")
    except ValueError:
        raise MapError(f"{name}: rows of cells are not all of one length; give (rows, columns)") from None
    if cells.ndim != 2:
        raise MapError(f"{name}: cells of shape {cells.shape} have not rows and columns alone; give (rows, columns)")
    if cells.size == 0:
        raise MapError(f"{name}: a grid of shape {cells.shape} has no cells; give at least one row and column")
    return _percentages(cells, name)


def _percentages(data: np.ndarray, name: str) -> np.ndarray:
    """Return cells as int8: Booleans as free and occupied, whole numbers from -1 to 100 as they are.

    Raises:
        MapError: they are something else.
    """
    if data.dtype == np.int8:
        return data
    if data.dtype == bool:
        return np.where(data, OCCUPIED, FREE).astype(np.int8)
    if data.dtype.kind not in "iuf":
        raise MapError(f"{name}: cells are of type {data.dtype}; give integers, or Booleans, of which True is an obstacle")
    if not ((data >= UNKNOWN) & (data <= OCCUPIED)).all():
        raise MapError(f"{name}: cells hold values from {data.min()} to {data.max()}; give -1 (unknown), or 0 to 100")
    cells = data.astype(np.int8)
    fractions = data[cells != data]
    if fractions.size:
        raise MapError(f"{name}: a cell holds {fractions[0].item()!r}; give whole percent from 0 (free) to 100 (occupied), such "
                       "as 100 * data rounded where they are probabilities")
    return cells


def check_meaning(data: np.ndarray, name: str) -> None:
    """Refuse a grid that is most likely one of 0 and 1, and warn of one that may be of small numbers for kinds of cells."""
    highest = int(data.max())
    if highest == 1:
        raise MapError(f"{name}: cells hold no value above 1, and 1 stands for 1 %, which is free; "
                       "give 100 for an obstacle, or data == 1, or percent=True if 1 % is meant")
    doubt = (f"no value above {highest}, which stands for {highest} %" if 1 < highest < LEAST_PERCENT else
             "1 and 100 and no value between, and 1 stands for 1 %"
             if highest == OCCUPIED and data.max(where=data < OCCUPIED, initial=FREE) == 1 else "")
    if doubt:
        warnings.warn(f"{name}: cells hold {doubt} and is free; give 100 for an obstacle and -1 for unknown, or "
                             "percent=True", DoubtfulGrid, stacklevel=4)
