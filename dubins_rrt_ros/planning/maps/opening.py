"""Open and read the files of maps: regular files, within limits; what goes wrong is said in a line."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from ..text import one_line
from .errors import MapError, MapNotFound

#: Default maximum number of cells of a grid: ten kilometres square at a resolution of 1 m, half a kilometre at 5 cm.
MAX_MAP_CELLS = 100_000_000


class ReadOptions(NamedTuple):
    """The options of all readers of map files.

    Attributes:
        max_map_cells: maximum number of cells of a grid.
        directory: the directory in which files must be, when links are followed; "" is any.
        unknown_grey: the brightness of unknown cells, whatever the thresholds say; -1 for none.
        resolution: the side of a cell of a picture that comes without a YAML file [m]; None where files say it.
    """

    max_map_cells: int = MAX_MAP_CELLS
    directory: str = ""
    unknown_grey: int = -1
    resolution: float | None = None


def expand_home(path: str | os.PathLike[str]) -> Path:
    """Return a path with a leading `~` replaced by the home directory."""
    try:
        return Path(os.path.expanduser(path))
    except ValueError:  # a home directory of nobody that there can be
        return Path(path)


def check_inside(path: Path, directory: str) -> None:
    """Refuse a file that is not in a directory, once all links are followed; "" is any.

    Raises:
        MapNotFound: it is not.
    """
    try:
        is_inside = not directory or Path(os.path.realpath(path)).is_relative_to(os.path.realpath(expand_home(directory)))
    except ValueError:  # one of them is no possible name
        is_inside = False
    if not is_inside:
        raise MapNotFound(f"is outside of map_directory = {directory}; name a file in there, or set another directory")


@contextlib.contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Open a file while the context lasts.

    Raises:
        MapNotFound: it cannot be opened.
        MapError: it cannot be read.
    """
    file = _open(path)
    try:
        with file:
            yield file
    except OSError as error:
        raise MapError(f"cannot be read ({error.strerror}); give a regular file on a disk that works") from None


def _open(path: Path) -> BinaryIO:
    # A pipe would wait for its other end.
    if os.path.exists(path) and not os.path.isfile(path):
        raise MapNotFound("is a directory, pipe or device; name a regular file")
    try:
        return path.open("rb")
    except OSError as error:
        raise MapNotFound(f"cannot be read ({error.strerror}); correct the name or the file's permissions") from None
    except ValueError as error:
        raise MapNotFound(f"is no possible file name ({error}); correct the name") from None


def read_text(path: Path, max_bytes: int, refusal: type[MapError] = MapError) -> str:
    """Read a text file.

    Raises:
        MapNotFound: it cannot be opened.
        MapError: it cannot be read, or, as a `refusal`, it is too long, empty or no UTF-8.
    """
    with opened(path) as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise refusal(f"is larger than {max_bytes} bytes; split or simplify it")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refusal(f"is not UTF-8 at byte {error.start}; save it as UTF-8") from None
    if not text.strip():
        raise refusal("is empty; give a file with a map in it")
    return text


def located(path: Path, error: MapError) -> MapError:
    """Return the error, of the same class, with the file's name in front, which a map's own errors give already."""
    return type(error)(f"{path}: {str(error).removeprefix(one_line(path.name) + ': ')}")
