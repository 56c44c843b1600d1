"""The costs of edges and paths as arrays; `_kernels/edge_cost.py` states them for the kernels."""

import numpy as np

from ..curves.path import Path


def edge_costs(lengths: np.ndarray) -> np.ndarray:
    """Return the (n,) costs of edges with (n, 3) lengths of arcs [m]: the lengths of the edges."""
    return np.asarray(lengths[:, 0] + lengths[:, 1] + lengths[:, 2])


def path_cost(path: Path) -> float:
    """Return the cost of a path [m], added up in the order of the tree's costs."""
    return float(np.cumsum([0.0, *edge_costs(path.lengths[1:])])[-1])
