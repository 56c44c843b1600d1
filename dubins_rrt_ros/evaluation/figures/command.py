"""`dubins_rrt figures`: draw the figures of the documentation, from what the planner itself computes."""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from dubins_rrt_ros.cli.common.extras import require_matplotlib
from dubins_rrt_ros.cli.common.output import check_folder, words_for, write_document
from dubins_rrt_ros.cli.common.parser import Parser, add_json_flag, describe
from dubins_rrt_ros.cli.common.progress import with_bar

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = "docs/figures"
#: Formats, with their resolution [pixels/inch]. In .svg only trees and colour maps are pixels, enough for a page.
FORMATS = {".svg": 110, ".png": 160}


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="[options]",
        description="Draws every figure of docs/ as .svg and .png: what they show is computed by the planner itself, so they "
                    "are right for this version.",
        notes="Drawn again by the same versions of this package and matplotlib, the files are the same to the byte.",
        examples=["dubins_rrt figures --out figures"], exit_status="0 done, 2 wrong usage, 130 interrupted")
    parser.add_argument("--out", metavar="DIR", default=FOLDER, help=f"folder to write to; default {FOLDER}")
    add_json_flag(parser, "the files' names")


def run(arguments: argparse.Namespace) -> int:
    """Draw the figures, report, and return the exit status."""
    check_folder(arguments.json)
    require_matplotlib("evaluation")
    folder, figures = Path(arguments.out), all_figures()
    folder.mkdir(parents=True, exist_ok=True)
    files = [file for written in with_bar(_written(figures, folder), len(figures), " figures") for file in written]
    if arguments.json:
        write_document(arguments.json, {"files": files})
    print(f"{folder}: {len(figures)} figures, each as {' and '.join(FORMATS)}", file=words_for(arguments.json))
    return 0


def all_figures() -> "dict[str, Callable[[], Figure]]":
    """Return the functions that draw the figures, by the names of their files without the ending."""
    from . import geometry as figures_geometry  # here, since matplotlib is slow to import
    from . import search as figures_search
    return figures_geometry.FIGURES | figures_search.FIGURES


def _written(figures: "dict[str, Callable[[], Figure]]", folder: Path) -> Iterator[list[str]]:
    """Yield the names of each figure's files as soon as they are written."""
    for name, drawn in figures.items():
        yield save(drawn(), folder / name)


def save(figure: "Figure", path: Path) -> list[str]:
    """Write a figure in all formats, the same one always as the same bytes, and return the names of its files."""
    from matplotlib import rc_context
    files = {str(path.with_suffix(ending)): dpi for ending, dpi in FORMATS.items()}
    with rc_context({"svg.hashsalt": "dubins_rrt_ros"}):  # in place of random names in the file
        for file, dpi in files.items():
            figure.savefig(file, dpi=dpi, metadata={"Date": None} if file.endswith(".svg") else None)
    return list(files)
