"""What a path costs: the sum of the costs of its edges, which `_kernels/edge_cost.py` states."""

from ..curves.path import Path


def path_cost(path: Path) -> float:
    """Return the cost of a path [m]: its length, summed as the tree sums the costs of its edges."""
    return path.length
