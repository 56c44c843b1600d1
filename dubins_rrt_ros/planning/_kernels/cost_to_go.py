# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Cost-to-go around obstacles: a lower bound of the cost of any path of a disc that can turn on the spot.

The map is divided into squares, each a block of the clearance's cells. On those that may hold a free point the cost is that of
`Eikonal`: continuous, and linear on triangles. It is symmetric, so the source may be the goal (cost-to-go) or the start. A metre
in a square costs its slowness: 1 where the cost is the length.

Proof of the bound. No triangle has a gradient above its square's slowness, at most what a metre there costs, and at the source
the cost is at most 0. A path of the disc stays within squares that may hold a free point, and the cost is continuous where two of
these meet, in an edge or a node. So along the path the cost rises by at most what the path costs, however the nodes got theirs.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.dubins_rrt_ros.planning._kernels.eikonal import FAR, Eikonal, squared_slopes
    from cython.cimports.libc.math import NAN, atan2, sqrt
else:
    from math import atan2, sqrt
    from math import nan as NAN

    from .clearance import Clearance
    from .eikonal import FAR, Eikonal, squared_slopes

#: Allowance for rounding, both relative and in metres.
ROUNDING = cython.declare(cython.double, 1e-9)


def free_squares(clearance: Clearance, block: cython.int, required_clearance: cython.double):
    """Find the squares of `block` x `block` cells that may hold a point with the required clearance [m].

    Returns:
        (rows + 3, columns + 3) int8 for rows x columns squares, in a border of zeros: one before them and two behind.
    """
    rows: cython.int = clearance.field.shape[0]
    columns: cython.int = clearance.field.shape[1]
    found = np.zeros(((rows + block - 1) // block + 3, (columns + block - 1) // block + 3), np.int8)
    find_free_squares(clearance, block, required_clearance, found, 0, columns)
    return found


def find_free_squares(clearance: Clearance, block: cython.int, required_clearance: cython.double, free: cython.schar[:, ::1],
                      first: cython.int, last: cython.int):
    """Write what `free_squares` returns to `free`, for the squares with cells in the columns from `first` to before `last`."""
    row: cython.int
    column: cython.int
    begin: cython.int = first // block * block
    end: cython.int = min((last + block - 1) // block * block, cython.cast(cython.int, clearance.field.shape[1]))
    with cython.nogil:
        free[:, begin // block + 1:(end + block - 1) // block + 1] = 0
        for row in range(cython.cast(cython.int, clearance.field.shape[0])):
            for column in range(begin, end):
                if not free[row // block + 1, column // block + 1] and may_be_free(clearance, row, column, required_clearance):
                    free[row // block + 1, column // block + 1] = 1


def clearance_slowness(clearance: Clearance, block: cython.int, free: cython.schar[:, ::1], required_clearance: cython.double,
                       preferred_clearance: cython.double, weight: cython.double, parts: cython.int, farther: cython.double):
    """Find what a metre costs in each of the `free_squares` by its room, that in the middles of `parts` x `parts` parts of it.

    Args:
        block, free: as for `free_squares`.
        required_clearance, preferred_clearance, weight: of the cost, as `_kernels/edge_cost.py` says [m].
        farther: added to the clearances in the middles, in diagonals of a part: 0.5 makes the costs lower bounds.

    Returns:
        Like `free_squares`, float64; 1 for other squares.
    """
    found = np.ones((free.shape[0], free.shape[1]))
    out: cython.double[:, ::1] = found
    side: cython.double = block * clearance.resolution / parts
    # A square at the map's edge can reach beyond it.
    middles = np.minimum((np.arange((found.shape[1] - 3) * parts) + 0.5) * side, clearance.width)
    x: cython.double[::1] = middles
    cells: cython.int[::1] = np.minimum(middles / clearance.resolution, clearance.field.shape[1] - 1).astype(np.int32)
    greatest: cython.double[::1] = np.empty(found.shape[1])
    enough: cython.double = required_clearance + preferred_clearance
    row: cython.int
    column: cython.int
    part: cython.int
    i: cython.int
    cell_row: cython.int
    y: cython.double
    bound: cython.double
    lack: cython.double
    farther *= side * sqrt(2.0)
    with cython.nogil:
        for row in range(1, cython.cast(cython.int, free.shape[0]) - 2):
            greatest[:] = 0
            for part in range(parts):
                y = min(((row - 1) * parts + part + 0.5) * side, clearance.height)
                cell_row = clearance.row_of(y)
                for column in range(1, cython.cast(cython.int, free.shape[1]) - 2):
                    if not free[row, column]:
                        continue
                    for i in range((column - 1) * parts, column * parts):
                        if greatest[column] >= enough:
                            break
                        bound = cython.cast(cython.double, clearance.field[cell_row, cells[i]])
                        if bound < enough:
                            bound = clearance.exact(x[i], y)
                        greatest[column] = max(greatest[column], bound + farther)
            for column in range(1, cython.cast(cython.int, free.shape[1]) - 2):
                lack = 1 - max(0.0, greatest[column] - required_clearance) / preferred_clearance
                if free[row, column] and lack > 0:
                    out[row, column] = 1 + weight * (lack * lack)
    return found


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def may_be_free(clearance: Clearance, row: cython.int, column: cython.int, required_clearance: cython.double) -> cython.bint:
    """Return whether a cell may hold a free point: the centre of a quarter lacks at most half of the quarter's diagonal."""
    side: cython.double = clearance.resolution
    bound: cython.double = cython.cast(cython.double, clearance.field[row, column])
    if bound < 0 or bound >= required_clearance:
        return bound >= 0
    if bound + side * sqrt(8.0) < required_clearance:  # `bound` is at most two diagonals below the clearance
        return False
    farther: cython.double = side * (sqrt(0.125) + ROUNDING)
    enough: cython.double = required_clearance - farther
    if clearance.exact((column + 0.5) * side, (row + 0.5) * side) + farther < enough:  # so has none of the quarters' centres
        return False
    quarter: cython.int
    for quarter in range(4):
        if clearance.exact((column + 0.25 + 0.5 * (quarter & 1)) * side, (row + 0.25 + 0.5 * (quarter >> 1)) * side) >= enough:
            return True
    return False


@cython.cclass
class CostToGoKernel:
    """The costs of the nodes. Square s = row * width + column has the nodes s, s + 1, s + width and s + width + 1.

    Attributes:
        shape: (rows, columns) of the nodes with their border; `columns` is the width.
        side: side of a square [m].
        is_bound: whether the costs are lower bounds; before `make_bound` they can be some hundredths too high.
    """

    def __init__(self, clearance: Clearance, block: cython.int, free, source, tolerance: cython.double, target, slowness=None):
        """Start at the source.

        Args:
            block: side of a square, in cells of the clearance's raster.
            free: what `free_squares` returns for this block.
            source: (x, y) in the map's frame [m].
            tolerance: radius around `source` within which the cost is 0 [m].
            target: (x, y) towards which costs are found first, or None.
            slowness: that of the squares and of the nodes, as `Eikonal` takes it; None is 1.
        """
        self.clearance, self.side = clearance, block * clearance.resolution
        self.squares, self.shape, self.width, self.size = free, free.shape, free.shape[1], free.size
        self.tolerance, self.deduction, self.is_bound, self.flat = tolerance / self.side, 0, False, None
        self.column, self.row = self.place(source[0], source[1])
        self.slowness = slowness
        self.use(self.started_equation(target))

    def prepare_bound(self, slowness=None):
        """Do the long part of `make_bound`, without a change of the costs; `slowness` is then a lower bound of the true one."""
        if self.flat is None:
            self.slowness = slowness
            flat: Eikonal = self.started_equation(None)
            flat.flatten()
            self.flat = flat

    def make_bound(self):
        """Lower the costs to lower bounds of the costs of paths, which `prepare_bound` has prepared."""
        if self.is_bound:
            return
        self.use(self.flat)
        self.is_bound = True
        # The nodes around a point of the source have at most their distances to it: at the point, interpolated, sqrt(1 / 2).
        self.deduction = sqrt(0.5) if self.tolerance > 0 else self.squares_to(self.column, self.row)

    def started_equation(self, target):
        """Return the equation, started at the source."""
        equation: Eikonal = Eikonal(self.squares, self.slowness)
        if target is not None:
            equation.aim(*self.place(target[0], target[1]))
        equation.begin(self.column, self.row, self.tolerance)
        return equation

    def use(self, equation: Eikonal):
        """Use the costs of an equation."""
        self.equation, self.free, self.cost = equation, equation.free, equation.cost

    def finish(self):
        """Compute the costs of all nodes now, so that several threads may read them."""
        self.equation.finish()

    def nodes(self):
        """Return the costs of the nodes [m], float64 of `shape`; 1e300 where they cannot be reached."""
        self.finish()
        costs = np.asarray(self.cost).reshape(self.shape)
        return np.where(costs < FAR, (costs - self.deduction) * self.side * (1 - ROUNDING) - ROUNDING, FAR)

    def values(self, points: cython.double[:, ::1], out: cython.double[::1]):
        """Write the costs at (n, 2) points of the map's frame to `out` [m]; 1e300 where they cannot be reached."""
        i: cython.Py_ssize_t
        with cython.nogil:
            for i in range(points.shape[0]):
                out[i] = self.at(points[i, 0], points[i, 1])

    def descent(self, points: cython.double[:, ::1], out: cython.double[::1]):
        """Write the headings of steepest descent at (n, 2) points of the map's frame to `out` [rad]; NaN where there is none."""
        self.finish()
        i: cython.Py_ssize_t
        with cython.nogil:
            for i in range(points.shape[0]):
                out[i] = self.heading(points[i, 0], points[i, 1])

    def at(self, x, y):
        """Return the cost at a point of the map's frame [m], not below 0; 1e300 where it cannot be reached."""
        column: cython.double
        row: cython.double
        column, row = self.place(x, y)
        cost: cython.double = self.squares_to(column, row)
        return max(0.0, (cost - self.deduction) * self.side * (1 - ROUNDING) - ROUNDING) if cost < FAR else FAR

    def squares_to(self, column, row):
        """Return the cost at a column and row in sides of a square, before the deduction; 1e300 where it cannot be reached."""
        square: cython.int = self.square_at(column, row)
        if square < 0 or not self.free[square]:
            return FAR
        self.equation.ensure_final(square)
        if self.cost[square] >= FAR:
            return FAR
        return self.within(square, column - square % self.width, row - square // self.width)

    def heading(self, x, y):
        """Return the heading of descent at a point, averaged over the nodes around it; NaN where the cost falls at none."""
        column: cython.double
        row: cython.double
        column, row = self.place(x, y)
        square: cython.int = self.square_at(column, row)
        if square < 0:
            return NAN
        column -= square % self.width
        row -= square // self.width
        along: cython.double = 0
        across: cython.double = 0
        weight: cython.double
        node: cython.int
        corner: cython.int
        for corner in range(4):
            weight = (column if corner & 1 else 1 - column) * (row if corner & 2 else 1 - row)
            node = square + (corner & 1) + (self.width if corner & 2 else 0)
            along += weight * self.fall(node, 1, self.width)
            across += weight * self.fall(node, self.width, 1)
        if along == 0 and across == 0:
            return NAN
        return atan2(self.clearance.sin_yaw * along + self.clearance.cos_yaw * across,
                     self.clearance.cos_yaw * along - self.clearance.sin_yaw * across)

    def place(self, x, y):
        """Return the column and row of a point of the map's frame, whole numbers at the nodes."""
        dx: cython.double = x - self.clearance.x0
        dy: cython.double = y - self.clearance.y0
        return (1 + (self.clearance.cos_yaw * dx + self.clearance.sin_yaw * dy) / self.side,
                1 + (self.clearance.cos_yaw * dy - self.clearance.sin_yaw * dx) / self.side)

    def square_at(self, column, row):
        """Return the square that holds a place, or -1 beyond the squares."""
        columns: cython.int = self.width - 3
        rows: cython.int = self.size // self.width - 3
        if not (1 <= column <= columns + 1 and 1 <= row <= rows + 1):
            return -1
        return min(cython.cast(cython.int, row), rows) * self.width + min(cython.cast(cython.int, column), columns)

    def within(self, square, along, across):
        """Return the cost within a square, interpolated at shares `along` and `across` of its sides."""
        here: cython.double = self.cost[square]
        right: cython.double = self.cost[square + 1]
        above: cython.double = self.cost[square + self.width]
        beyond: cython.double = self.cost[square + self.width + 1]
        upwards: cython.double
        downwards: cython.double
        upwards, downwards = squared_slopes(here, right, above, beyond)
        if upwards <= downwards:
            if along >= across:
                return here + along * (right - here) + across * (beyond - right)
            return here + across * (above - here) + along * (beyond - above)
        if along + across <= 1:
            return here + along * (right - here) + across * (above - here)
        return beyond + (1 - along) * (above - beyond) + (1 - across) * (right - beyond)

    def fall(self, node, step, across):
        """Return the decrease of the cost from a node to its cheaper neighbour `step` before or behind; negative if before."""
        ahead: cython.double = FAR
        behind: cython.double = FAR
        if self.free[node] or self.free[node - across]:
            ahead = self.cost[node + step]
        if self.free[node - step] or self.free[node - step - across]:
            behind = self.cost[node - step]
        if ahead < behind:
            return max(0.0, self.cost[node] - ahead)
        return -max(0.0, self.cost[node] - behind) if behind < FAR else 0.0
