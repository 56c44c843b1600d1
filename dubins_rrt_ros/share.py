"""Where the package's maps and its node are, whichever way it was installed."""

import os
import sys
from pathlib import Path

from .planning import MapError

PACKAGE = "dubins_rrt_ros"


def _prefixes() -> list[Path]:
    """Where the package may be installed: the ament index' prefixes (colcon, apt), then the interpreter's own (pip)."""
    ament = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    return [*ament, Path(sys.prefix)]


def maps_directory() -> Path:
    """The folder of the package's own maps: in the share folder, or in the source tree."""
    folders = [prefix / "share" / PACKAGE / "maps" for prefix in _prefixes()]
    return next((folder for folder in folders if folder.is_dir()), Path(__file__).resolve().parent.parent / "maps")


def find_map(name: str) -> Path:
    """The file of a map: a path as it is, or the name of one of the package's own, with or without its ending.

    Raises:
        MapError: there is none.
    """
    path, own = Path(name), maps_directory()
    for candidate in (path, own / path.name, own / f"{path.name}.yaml"):
        if candidate.is_file():
            return candidate
    names = ", ".join(sorted(file.name for file in own.glob("*") if file.suffix in (".yaml", ".geojson", ".wkt")))
    raise MapError(f"{name}: no such map file; give a path or one of the package's own maps: {names or 'none are installed'}")


def planner_command() -> list[str]:
    """The command that starts the node: the installed executable, or the source tree's."""
    executables = [prefix / folder / "planner" for prefix in _prefixes() for folder in (f"lib/{PACKAGE}", "bin")]
    executable = next((file for file in executables if os.access(file, os.X_OK)), None)
    return [str(executable)] if executable else [sys.executable, "-m", f"{PACKAGE}.node"]
