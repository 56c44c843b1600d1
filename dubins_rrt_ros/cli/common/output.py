"""The files that commands write: JSON and CSV here, pictures in plots.py. All are checked before the work begins."""

import csv
import json
import math
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from dubins_rrt_ros.planning import Plan
from dubins_rrt_ros.planning.pictures import ANIMATIONS, VIDEO
from dubins_rrt_ros.planning.plan_file import to_document

from .extras import require_ffmpeg, require_matplotlib
from .parser import UsageError

STDOUT = "-"
#: Header of the CSV of a path.
CSV_COLUMNS = ("x", "y", "theta", "clearance", "curvature")
DRAWINGS = (".png", ".svg", ".pdf")


def check_folder(*files: str | None, sources: Iterable[str] = ()) -> None:
    """Refuse a file that cannot be written, or would take the place of another. Called before the work, so that none is lost.

    Args:
        files: to be written.
        sources: to be read.

    Raises:
        UsageError: one of the files has no name or folder, is one, is named twice, or is a source.
    """
    read, written = {_real(source) for source in sources}, set()
    for file in files:
        if file is None or file == STDOUT:
            continue
        if not file:
            raise UsageError("the name of a file to write is empty; give one, or leave the flag out")
        path = _real(file)
        if not path.parent.is_dir():
            raise UsageError(f"there is no folder {Path(file).parent} to write {path.name} to; make it first")
        if path.is_dir():
            raise UsageError(f"{file} is a folder; name a file to write to")
        if path in written and (path.is_file() or not path.exists()):  # a device takes both
            raise UsageError(f"{file} is to be written twice, so that the first would be lost; name another file")
        if path in read:
            raise UsageError(f"{file} is read, and would be written over; name another file")
        written.add(path)


def _real(file: str) -> Path:
    """Return a path with all links followed, but for those that lead back to themselves, which `Path.resolve` raises for."""
    return Path(os.path.realpath(file))


def check_drawing(file: str | None, endings: tuple[str, ...] = DRAWINGS) -> None:
    """Refuse a picture that cannot be drawn. Called before planning, so that no plan is lost.

    Raises:
        UsageError: the name does not end with one of the endings, or what draws it is not installed.
    """
    if not file:
        return
    if Path(file).suffix.lower() not in endings:
        raise UsageError(f"a picture named {file} cannot be drawn; let the name end with one of {', '.join(endings)}")
    require_matplotlib()
    if Path(file).suffix.lower() == VIDEO:
        require_ffmpeg()


def is_animation(file: str | None) -> bool:
    """Return True if the ending of a file is that of an animation."""
    return file is not None and Path(file).suffix.lower() in ANIMATIONS


def words_for(json_file: str | None) -> TextIO:
    """Return the stream for people: standard error where standard output holds the JSON, standard output elsewhere."""
    return sys.stderr if json_file == STDOUT else sys.stdout


def finite(document: Any) -> Any:
    """Return a document with null in place of infinite numbers and NaN, which JSON has not."""
    if isinstance(document, dict):
        return {name: finite(value) for name, value in document.items()}
    if isinstance(document, list | tuple):
        return [finite(value) for value in document]
    return None if isinstance(document, float) and not math.isfinite(document) else document


def write_json(file: str, plan: Plan, map_name: str) -> None:
    """Write the plan; `file` may be - for standard output."""
    write_document(file, to_document(plan, map_name))


def write_document(file: str, document: dict[str, Any]) -> None:
    """Write JSON; `file` may be - for standard output."""
    text = json.dumps(document, allow_nan=False)
    if file == STDOUT:
        print(text)
    else:
        Path(file).write_text(text + "\n", encoding="utf-8")


def write_csv(file: str, plan: Plan) -> None:
    """Write the poses of the path at the spacing of the settings: a header, and a row each.

    The clearance is that of a disc's middle or of the footprint [m], the curvature that of what is driven next, positive to the
    left [1/m].
    """
    poses = plan.poses()
    rows = np.column_stack([poses, plan.clearances(), _curvatures(poses)]).tolist() if len(poses) else []
    with Path(file).open("w", newline="", encoding="utf-8") as out:
        csv.writer(out, lineterminator="\n").writerows([CSV_COLUMNS, *rows])


def _curvatures(poses: np.ndarray) -> np.ndarray:
    """Return the (n,) curvatures of the arcs between (n, 3) poses, and of the last one again [1/m]."""
    if len(poses) < 2:
        return np.zeros(len(poses))
    x, y, turn = np.diff(poses, axis=0).T
    half = np.remainder(turn + math.pi, math.tau) / 2 - math.pi / 2
    chord = np.hypot(x, y)
    curvature = np.divide(2 * np.sin(half), chord, out=np.zeros(len(chord)), where=chord > 0)
    return np.append(curvature, curvature[-1])
