"""The objective of a search, for one vehicle on one map; `_kernels/edge_cost.py` states it for the kernels."""

import math
from dataclasses import dataclass

import numpy as np

from .._kernels.edge_cost import EdgeCost
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..problem import Problem
from ..settings import ROOMY, Settings
from ..vehicle import Vehicle

#: Distance between the points whose room is measured, in preferred clearances, and their maximum number.
SPACING, MOST_POINTS = 1 / 4, 5_000


@dataclass(frozen=True, eq=False)
class Objective:
    """The cost that is minimised: the length, or one that rises where the vehicle has less room than it prefers, or cells cost.

    Attributes:
        vehicle, field: the vehicle, and the clearance of the map.
        preferred_clearance: room from which on a metre costs a metre [m]; 0 makes the cost the length.
        weight: what a metre in contact costs above its length [m].
        cell_weight: what a metre over a cell of 100 % costs above its length [m].
    """

    vehicle: Vehicle
    field: ClearanceField
    preferred_clearance: float = 0.0
    weight: float = 0.0
    cell_weight: float = 0.0

    @classmethod
    def of(cls, problem: Problem, settings: Settings, field: ClearanceField) -> "Objective":
        """Return what the settings ask for."""
        preferred = settings.preferred_clearance_of(problem.vehicle)
        return cls(problem.vehicle, field, preferred, settings.clearance_weight if preferred > 0 else 0.0,
                   settings.weight_of_cells if field.cost_cells else 0.0)

    @property
    def is_length(self) -> bool:
        """True if the cost is the length."""
        return (self.preferred_clearance == 0 or self.weight == 0) and self.cell_weight == 0

    def edge_cost(self) -> EdgeCost:
        """Return the kernel, for one thread."""
        if self.is_length:
            return EdgeCost()
        cells = self.field.cost_cells
        return EdgeCost(self.field.room(self.vehicle), self.preferred_clearance, self.weight,
                        cells.kernel() if cells else None, self.cell_weight if cells else 0.0)

    def slowness(self, is_bound: bool) -> tuple[np.ndarray, np.ndarray] | None:
        """Return what a metre costs in the free squares and at their nodes; None where it is 1.

        Args:
            is_bound: True for lower bounds, False for estimates.
        """
        if self.is_length or self.vehicle.required_clearance < 0:  # which tells nothing of the room from the reference point's
            return None
        return self.field.slowness(self.vehicle.inscribed_radius, self.preferred_clearance, self.weight, self.cell_weight,
                                   is_bound)

    def edge_costs(self, starts: np.ndarray, radius: float, words: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Return the (n,) costs of edges with (n, 3) lengths of arcs from (n, 3) poses [m]."""
        if self.is_length:
            return lengths_of(lengths)
        out = np.empty(len(words))
        starts, lengths = (np.require(array, float, ["C", "W"]) for array in (starts, lengths))
        self.edge_cost().costs(starts, radius, np.require(words, np.int8, ["C", "W"]), lengths, out)
        return out

    def curve_costs(self, path: Path) -> np.ndarray:
        """Return the (n,) costs of the curves of a path [m]."""
        return self.edge_costs(path.waypoints[:-1], path.radius, path.words[1:], path.lengths[1:])

    def path_cost(self, path: Path) -> float:
        """Return the cost of a path [m], added up in the order of the tree's costs."""
        return float(np.cumsum([0.0, *self.curve_costs(path)])[-1])

    def roomy_share(self, path: Path) -> float | None:
        """Return the share of a path's length with room of 0.8 preferred clearances; None where there is none of either."""
        if self.preferred_clearance == 0 or self.weight == 0 or path.length == 0:
            return None
        enough = ROOMY * self.preferred_clearance
        points = max(1, min(math.ceil(path.length / (SPACING * self.preferred_clearance)), MOST_POINTS))
        poses, rooms = path.at((np.arange(points) + 0.5) / points), np.empty(points)
        self.field.room(self.vehicle).rooms(np.require(poses, float, ["C", "W"]), enough, rooms)
        return float((rooms >= enough).mean())


def minimises_length(problem: Problem, settings: Settings) -> bool:
    """Return True if what is minimised is the length; the problem's map is as the settings have it."""
    return settings.preferred_clearance_of(problem.vehicle) == 0 and (problem.map.costs is None or settings.weight_of_cells == 0)


def lengths_of(lengths: np.ndarray) -> np.ndarray:
    """Return the (n,) lengths of edges with (n, 3) lengths of arcs [m], added up as the kernels do."""
    return np.asarray(lengths[:, 0] + lengths[:, 1] + lengths[:, 2])
