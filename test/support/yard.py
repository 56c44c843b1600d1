"""A map with something of everything, and poses on it."""

import math

import numpy as np

START, GOAL, BEHIND = (1.5, 5.0, 0.0), (8.5, 5.0, 0.5), (1.5, 2.0, -2.0)
IN_THE_BOX, IN_UNKNOWN, IN_THE_CHAMBER = (5.0, 5.0, 0.0), (1.0, 9.0, math.pi), (9.0, 9.0, 0.0)
#: On the way out of the corridor: it is free, but a car that drives in cannot turn round.
ON_THE_WAY_OUT = (6.0, 0.6, math.pi)
QUICK = {"samples": 300, "planning_time": 60.0, "seed": 1}
ENDLESS = {"samples": 10_000_000, "planning_time": 600.0, "seed": 1}


def yard() -> np.ndarray:
    """10 m x 10 m in cells of 0.1 m: a box of 2 m in the middle, the upper left corner unknown, in the upper right one a closed
    chamber, and along the lower edge a corridor of 1.2 m that is closed at its right end."""
    cells = np.zeros((100, 100), dtype=np.int8)
    cells[40:60, 40:60] = 100
    cells[80:, :20] = -1
    cells[78:80, 78:] = cells[78:, 78:80] = 100
    cells[12:14, 50:] = 100
    return cells
