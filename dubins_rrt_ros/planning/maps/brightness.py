"""The cells that the pixels of a picture stand for, by the rules of map_server in ROS 2 Jazzy."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .cells import FREE, OCCUPIED, UNKNOWN
from .images import Picture
from .model import DEFAULT_THRESHOLDS

MODES = ("trinary", "scale", "raw")
#: The brightness that trinary files have for free, occupied and unknown cells.
FREE_GREY, OCCUPIED_GREY, UNKNOWN_GREY = 254, 0, 205
#: Share of transparent pixels beyond which these are doubtful: a drawing of walls alone, saved without its background.
MOST_TRANSPARENT = 0.5


class Rules(NamedTuple):
    """The meaning of brightness: the fields of a map_server file of these names.

    By default those of files that keep free, occupied and unknown cells apart.
    """

    mode: str = "trinary"
    negate: bool = False
    occupied_thresh: float = 0.65
    free_thresh: float = 0.196

    def cell_values(self) -> np.ndarray:
        """Return (256,) int8: the cell that each brightness stands for.

        Jazzy compares in single precision, both thresholds inclusive, and rounds halves away from zero; raw knows neither
        `negate` nor thresholds.
        """
        grey = np.arange(256)
        if self.mode == "raw":
            return np.where(grey <= OCCUPIED, grey, UNKNOWN).astype(np.int8)
        shade = grey.astype(np.float32) / np.float32(255)
        occupancy = shade if self.negate else np.float32(1) - shade
        between: np.ndarray | int = UNKNOWN
        if self.mode == "scale":
            width = np.float32(self.occupied_thresh - self.free_thresh)
            scaled = (occupancy - np.float32(self.free_thresh)) / width * np.float32(100)
            between = np.floor(scaled.astype(float) + 0.5)
        values = np.where(occupancy >= np.float32(self.occupied_thresh), OCCUPIED, between)
        return np.where(occupancy <= np.float32(self.free_thresh), FREE, values).astype(np.int8)


def cells_of(picture: Picture, rules: Rules, unknown_grey: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the (height, width) int8 cells of a picture, the lowest row first, and what a person should know of them.

    Args:
        picture: as it was read.
        rules: what brightness means.
        unknown_grey: the brightness of unknown cells, whatever the rules say; -1 for none.
    """
    values = rules.cell_values()
    if unknown_grey >= 0:
        values[unknown_grey] = UNKNOWN
    # Row 0 of an image is the top, of a grid the bottom.
    cells = values[picture.grey[::-1]]
    if picture.transparent is not None and rules.mode != "raw":
        cells[picture.transparent[::-1]] = UNKNOWN
    doubts = (*_unknown_taken_as_free(picture, rules, cells), *_transparency(picture, rules), *_colours(picture, values))
    return cells, doubts or tuple(_nothing_free(picture, rules, cells))


def _unknown_taken_as_free(picture: Picture, rules: Rules, cells: np.ndarray) -> Iterator[str]:
    grey = 255 - UNKNOWN_GREY if rules.negate else UNKNOWN_GREY
    share = 0.0 if rules.mode == "raw" else float(np.mean((picture.grey[::-1] == grey) & (cells == FREE)))
    if share > 0:
        yield (f"{share:.2%} of the cells have the grey {grey}, as unknown space has it, and are free by free_thresh: "
               f"{rules.free_thresh:g}, as for map_server; if they are unknown, set free_thresh: {Rules().free_thresh:g}, or "
               f"take that grey as unknown, by unknown_grey = {grey} (--unknown-grey {grey})")


def _transparency(picture: Picture, rules: Rules) -> Iterator[str]:
    share = 0.0 if picture.transparent is None or rules.mode == "raw" else float(np.mean(picture.transparent))
    if share > MOST_TRANSPARENT:
        yield (f"{share:.2%} of the pixels are transparent, and so unknown, as for map_server; if they are free, save the image "
               "without transparency, on white")


def _nothing_free(picture: Picture, rules: Rules, cells: np.ndarray) -> Iterator[str]:
    """Yield that there is no room at all, as where 0 and 1 or percent were saved in place of brightness."""
    if not ((cells >= FREE) & (cells <= DEFAULT_THRESHOLDS.free_up_to)).any():
        yield (f"no cell is free: the pixels have a brightness of {picture.grey.min()} to {picture.grey.max()}, of 0 (black) to "
               f"255 (white), in the mode {rules.mode} with negate: {int(rules.negate)}; draw free space white")


def _colours(picture: Picture, values: np.ndarray) -> Iterator[str]:
    if picture.colours:
        became = (f"{colour} became {DEFAULT_THRESHOLDS.meaning(int(values[grey]))}" for colour, grey in picture.colours.items())
        yield (f"the image is coloured, and a map knows brightness alone: {', '.join(became)}; draw obstacles black, free space "
               f"white and unknown space in the grey {UNKNOWN_GREY}")
