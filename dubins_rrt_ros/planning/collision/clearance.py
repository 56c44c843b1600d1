"""Exact distance to the nearest obstacle, computed once per map; everything outside the map is an obstacle.

Guarantee: along a curve that `curve_is_free` accepts the vehicle touches no obstacle anywhere, between samples too, and keeps a
quarter of CLEARANCE_MARGIN from them; a curve along which it keeps CLEARANCE_MARGIN (a disc) or sqrt(2) of that (a polygon) is
always accepted. `_kernels/clearance.py` and `_kernels/collision.py` have the proofs. The distances are those to the squares of
occupied cells, or to polygons, in double precision; nothing is rounded to cells.
"""

import copy
import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from scipy import ndimage

from .._kernels import COMPILED
from .._kernels.clearance import GridClearance, PolygonClearance
from .._kernels.collision import CollisionChecker, PolygonChecker, TestedChecker
from .._kernels.components import label_components
from .._kernels.cost_to_go import clearance_slowness, find_free_squares, free_squares
from .._kernels.eikonal import node_slowness
from .._kernels.room import CornerIndex, FootprintRoom, Room
from ..curves.dubins import DubinsCurve
from ..curves.path import Path
from ..maps.frame import Frame
from ..maps.model import GridMap, Map
from ..problem import Pose
from ..vehicle import Vehicle
from .cell_costs import CostCells
from .footprint import cover
from .own_test import OwnTest
from .raster import CLEARANCE_MARGIN, grid_clearance, grid_corners, polygon_clearance

#: Side of the buckets of obstacles' corners, in cells of the raster.
BUCKET = 8
#: Number of parts along the side of a free square for which its greatest clearance is bounded, and estimated.
BOUND_PARTS, ESTIMATE_PARTS = 2, 1
#: Maximum side of a free square as a share of the required clearance, so that walls do not vanish between squares ...
SQUARE_SHARE = 0.6
#: ... and approximate maximum number of squares, for which they are made larger.
MAX_SQUARES = 270_000 if COMPILED else 4_000
#: Number of squares along the longer side of a map where obstacles do not matter to the reference point.
SQUARES_WITHOUT_OBSTACLES = 64


class FreeSquares(NamedTuple):
    """Squares of the raster's cells that may hold a point with the required clearance.

    Attributes:
        cells: the side of a square in cells of the raster.
        is_free: (rows, columns) of squares, with a row and a column more on each side.
    """

    cells: int
    is_free: np.ndarray


class ClearanceField:
    """The distance from any point to the nearest obstacle.

    Attributes:
        kernel: the compiled distances, for the planner's inner loop; its raster holds a lower bound for each cell.
        frame: the frame of the raster, whose origin is the corner of its first cell.
        own_test: a test of the user's for further obstacles, which the collision checkers ask too, or None.
        cost_cells: the cells of the grid, where some of them have costs; else None.
    """

    def __init__(self, world_map: Map, allow_unknown: bool = False, previous: "ClearanceField | None" = None):
        """Compute the distances.

        Where `previous` is the field of a grid of the same shape and resolution, only what depends on the cells that differ is
        computed; the result is the same as without it, and the previous field stays as it is.
        """
        self.kernel: GridClearance | PolygonClearance
        self.own_test: OwnTest | None = None
        self.cost_cells = CostCells.of(world_map, allow_unknown) if isinstance(world_map, GridMap) else None
        self._forget()
        if isinstance(world_map, GridMap):
            similar = previous.kernel if previous and isinstance(previous.kernel, GridClearance) else None
            self.kernel, differ = grid_clearance(world_map, allow_unknown, similar)
            self.frame, self._polygons = Frame(*world_map.origin), None
            if previous and differ is not None:
                self._take_over(previous, differ)
        else:
            self.kernel = polygon_clearance(world_map)
            x0, y0 = world_map.corners()[0].tolist()
            self.frame, self._polygons = Frame(x0, y0, 0.0), world_map.free

    def _forget(self) -> None:
        self._components: tuple[float, np.ndarray] | None = None
        self._free_squares: tuple[float, FreeSquares] | None = None
        self._slowness: dict[bool, tuple[tuple[float, ...], tuple[np.ndarray, np.ndarray]]] = {}

    def _take_over(self, previous: "ClearanceField", columns: list[slice]) -> None:
        """Take over from another field the components, if no columns differ, and the free squares of those that do not."""
        if not columns:
            self._components = previous._components
        if previous._free_squares is not None:
            required_clearance, (cells, squares) = previous._free_squares
            if columns and required_clearance >= 0:
                squares = squares.copy()
                for some in columns:
                    find_free_squares(self.kernel, cells, required_clearance, squares, some.start, some.stop)
            self._free_squares = required_clearance, FreeSquares(cells, squares)

    def shared(self) -> "ClearanceField":
        """Return the same distances for another vehicle, whose components and free squares are kept apart from these."""
        other = copy.copy(self)
        other._forget()
        return other

    def with_own_test(self, own_test: OwnTest) -> "ClearanceField":
        """Return the same distances, with collision checkers that ask a test of the user's too."""
        other = copy.copy(self)
        other.own_test = own_test
        return other

    def test_accepts(self, path: Path) -> bool:
        """Return False where a test of the user's refuses a path, as it is cut into curves; the checkers judge single curves."""
        return self.own_test is None or self.own_test.path_is_free(path)

    def raise_test_error(self) -> None:
        """Raise the exception of a test of the user's, if it raised one."""
        if self.own_test:
            self.own_test.raise_error()

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return the exact clearance at (..., 2) points [m]: 0 in obstacles and outside the map, in polygons too."""
        points = np.asarray(points, dtype=float)
        out = np.empty(points.shape[:-1])
        self.kernel.distances(np.require(points.reshape(-1, 2), requirements=["C", "W"]), out.reshape(-1))
        if self._polygons is not None:  # whose kernel gives the distance to their edges from both sides
            out[~shapely.contains_xy(self._polygons, points[..., 0], points[..., 1])] = 0
        return out

    def collision_checker(self, vehicle: Vehicle) -> CollisionChecker:
        """Return the checker of a vehicle's motions on the map, for one thread."""
        checker = self._checker_of_map(vehicle)
        return TestedChecker(checker, self.own_test) if self.own_test else checker

    def _checker_of_map(self, vehicle: Vehicle) -> CollisionChecker:
        if not vehicle.footprint:
            return CollisionChecker(clearance=self.kernel, required_clearance=vehicle.robot_radius)
        found = cover(vehicle.footprint)
        return PolygonChecker(clearance=self.kernel, required_clearance=vehicle.required_clearance, discs=found.discs,
                              corners=found.corners, first_corner=found.first_corner, part_discs=found.part_discs,
                              hull=found.hull, worth=max(found.excess, 2 * CLEARANCE_MARGIN))

    def room(self, vehicle: Vehicle) -> Room:
        """Return the room of a vehicle, the distance from its outline to the nearest obstacle, for one thread."""
        if not vehicle.footprint:
            return Room(self.kernel, vehicle.robot_radius)
        return FootprintRoom(self.kernel, cover(vehicle.footprint).discs, np.array(vehicle.footprint), self._corners)

    @cached_property
    def _corners(self) -> CornerIndex:
        if isinstance(self.kernel, GridClearance):
            points = grid_corners(np.asarray(self.kernel.row_gap) == 0, self.kernel.resolution)
        else:
            points = self.frame.from_map(shapely.get_coordinates(self._polygons))
        return CornerIndex(points, self.kernel.width, self.kernel.height, BUCKET * self.kernel.resolution)

    def clearances(self, poses: np.ndarray, vehicle: Vehicle) -> np.ndarray:
        """Return (n,) distances to the nearest obstacle at (n, 3) free poses [m]: from a disc's middle, or from a footprint."""
        if not vehicle.footprint:
            return self.at(poses[:, :2])
        out = np.empty(len(poses))
        self.room(vehicle).rooms(np.require(poses, float, ["C", "W"]), self.kernel.width + self.kernel.height, out)
        return out

    def pose_is_free(self, pose: Pose, vehicle: Vehicle) -> bool:
        """Return whether the vehicle touches no obstacle at a pose and keeps a margin of less than a millimetre."""
        return self._is_outside_obstacles(pose, vehicle) and self.collision_checker(vehicle).is_pose_free(pose)

    def curve_is_free(self, curve: DubinsCurve, vehicle: Vehicle) -> bool:
        """Return whether the vehicle touches no obstacle along a curve; `_kernels/collision.py` states the guarantee."""
        # What starts in free space stays there, as no edge is crossed.
        if not self._is_outside_obstacles(curve.start, vehicle):
            return False
        return self.collision_checker(vehicle).is_motion_free(curve.start, curve.radius, curve.index, curve.lengths)

    def _is_outside_obstacles(self, pose: Pose, vehicle: Vehicle) -> bool:
        """Return whether a point of the vehicle is in free space: the kernel's distance to polygons has no sign."""
        x, y, theta = pose
        if vehicle.required_clearance < 0:  # its reference point is no point of it
            along, across = vehicle.footprint[0]
            x += along * math.cos(theta) - across * math.sin(theta)
            y += along * math.sin(theta) + across * math.cos(theta)
        return bool(self.at(np.array([x, y])) > 0)

    def cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and columns of the raster's cells that hold (..., 2) points of the map."""
        rows, columns = self.kernel.field.shape
        places = self.frame.from_map(points) / self.kernel.resolution
        column, row = places[..., 0].astype(int), places[..., 1].astype(int)
        return np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)

    def may_be_free(self, points: np.ndarray, required_clearance: float) -> np.ndarray:
        """Return (n,) bool: True where the cells that hold (n, 2) points of the map are among the `possibly_free` ones."""
        return self._may_be_free(np.asarray(self.kernel.field)[self.cells(points)], required_clearance)

    def possibly_free(self, required_clearance: float) -> np.ndarray:
        """Return (rows, columns) bool: a superset of the raster's cells that hold a point with the required clearance [m]."""
        return self._may_be_free(np.asarray(self.kernel.field), required_clearance)

    def components(self, required_clearance: float) -> np.ndarray:
        """Return (rows, columns) int32: the connected components of the `possibly_free` cells, from 1 on, 0 elsewhere.

        They are kept for the last required clearance, since the requests of one vehicle ask for the same.
        """
        kept = self._components
        if kept is None or kept[0] != required_clearance:
            self._components = kept = required_clearance, self._find_components(required_clearance)
        return kept[1]

    def _find_components(self, required_clearance: float) -> np.ndarray:
        if not COMPILED:
            return np.asarray(ndimage.label(self.possibly_free(required_clearance), structure=np.ones((3, 3)))[0])
        labels = np.empty(self.kernel.field.shape, np.int32)
        label_components(self.kernel.field, self._least_bound(required_clearance), labels)
        return labels

    def free_squares(self, required_clearance: float) -> FreeSquares:
        """Return the squares that may hold a point with the required clearance [m]; they are kept for the last one."""
        kept = self._free_squares
        if kept is None or kept[0] != required_clearance:
            self._free_squares = kept = required_clearance, self._find_free_squares(required_clearance)
        return kept[1]

    def _find_free_squares(self, required_clearance: float) -> FreeSquares:
        shape = self.kernel.field.shape
        if required_clearance < 0:
            cells = math.ceil(max(shape) / SQUARES_WITHOUT_OBSTACLES)
            rows, columns = (math.ceil(side / cells) for side in shape)
            return FreeSquares(cells, np.pad(np.ones((rows, columns), np.int8), (1, 2)))  # a border as free_squares makes
        cells = _cells_of_square(shape, SQUARE_SHARE * required_clearance / self.kernel.resolution)
        return FreeSquares(cells, free_squares(self.kernel, cells, required_clearance))

    def slowness(self, required_clearance: float, preferred_clearance: float, weight: float, cell_weight: float, is_bound: bool
                 ) -> tuple[np.ndarray, np.ndarray]:
        """Return what a metre costs in each of the `free_squares`, and at least at each of their nodes.

        They are kept for the last values.

        Args:
            required_clearance: radius of the largest disc around the reference point in the vehicle [m].
            preferred_clearance, weight, cell_weight: of the cost, as `_kernels/edge_cost.py` says [m].
            is_bound: True for lower bounds in a square, False for estimates.
        """
        key = required_clearance, preferred_clearance, weight, cell_weight
        kept = self._slowness.get(is_bound)
        if kept is None or kept[0] != key:
            cells, squares = self.free_squares(required_clearance)
            of_squares = np.ones(squares.shape)
            if weight > 0:
                of_squares = clearance_slowness(self.kernel, cells, squares, required_clearance, preferred_clearance, weight,
                                                *((BOUND_PARTS, 0.5) if is_bound else (ESTIMATE_PARTS, 0.0)))
            if self.cost_cells and cell_weight > 0:
                of_squares[1:-2, 1:-2] += cell_weight * self.cost_cells.of_squares(cells, is_bound)
            self._slowness[is_bound] = kept = key, (of_squares, node_slowness(squares, of_squares))
        return kept[1]

    def _may_be_free(self, bounds: np.ndarray, required_clearance: float) -> np.ndarray:
        enough: np.ndarray = bounds >= self._least_bound(required_clearance)
        return enough

    def _least_bound(self, required_clearance: float) -> float:
        """Return the bound that a cell needs to hold a point with the required clearance [m]; that of an obstacle is -1."""
        if required_clearance < 0:
            return -math.inf
        # The bound of a cell is at most two of its diagonals below the clearance of any point in it.
        cell: float = self.kernel.resolution
        return max(0.0, required_clearance - 2 * math.sqrt(2) * cell - 1e-6)


def _cells_of_square(shape: tuple[int, int], wish: float) -> int:
    """Return the number of cells of the raster along the side of a free square."""
    return max(1, math.floor(wish), math.ceil(math.sqrt(shape[0] * shape[1] / MAX_SQUARES)))
