"""Shortcuts and detours: a path made shorter by Dubins curves that are as free."""

import numpy as np

from .._kernels.shortcut import Shortcutter
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..vehicle import Vehicle

#: How many changes are tried in one go.
TRIES = 512
#: The share of shortcuts, which are coarse, among them: for a path that was just found, and for one that was polished before.
FRESH, KNOWN = 0.8, 0.3


def polished(path: Path, vehicle: Vehicle, field: ClearanceField, rng: np.random.Generator, fresh: bool) -> Path:
    """A path with the same ends that is never longer.

    Args:
        path: it is free for the vehicle; so is the answer.
        fresh: whether it was not polished before, and may have large loops.
    """
    draws = np.column_stack([rng.random((TRIES, 4)), rng.normal(size=(TRIES, 2))])
    shortcutter = Shortcutter(checker=field.collision_checker(vehicle), radius=path.radius, poses=path.waypoints,
                              words=path.words, lengths=path.lengths, tries=TRIES)
    shortcutter.improve(draws, FRESH if fresh else KNOWN)
    arrays = (np.array(view[:shortcutter.count]) for view in (shortcutter.poses, shortcutter.words, shortcutter.lengths))
    return Path(*arrays, path.radius)
