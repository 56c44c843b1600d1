"""The independent judge of paths: shapely and plain numpy, no algorithm in common with the search."""

from .cost import cost_of, roomy_share_of
from .verdict import Audit, audit_path

__all__ = ["Audit", "audit_path", "cost_of", "roomy_share_of"]
