"""Where the package's maps and its node are, whichever way it was installed."""

import os
import sys
from pathlib import Path

from .planning import MapError

PACKAGE = "dubins_rrt_ros"


def _ament_prefixes() -> list[Path]:
    """Where colcon and apt may have installed the package."""
    return [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def maps_directory() -> Path:
    """The folder of the package's own maps: in the share folder (of colcon or apt, then of pip), or in the source tree."""
    folders = [prefix / "share" / PACKAGE / "maps" for prefix in (*_ament_prefixes(), Path(sys.prefix))]
    return next((folder for folder in folders if folder.is_dir()), Path(__file__).resolve().parent.parent / "maps")


def find_map(name: str) -> Path:
    """The file of a map: a path as it is, or the name of one of the package's own, with or without its ending.

    Raises:
        MapError: there is none.
    """
    path, own = Path(name), maps_directory()
    named = path.parent in (Path("."), Path("maps"))
    for candidate in (path, *((own / path.name, own / f"{path.name}.yaml") if named else ())):
        if candidate.is_file():
            return candidate
    names = ", ".join(sorted(file.name for file in own.glob("*") if file.suffix in (".yaml", ".geojson", ".wkt")))
    raise MapError(f"{name}: no such map file; give a path or one of the package's own maps: {names or 'none are installed'}")


def planner_command() -> list[str]:
    """The command that starts the node: the executable of colcon or apt, that of pip, or the source tree's module."""
    executables = [prefix / "lib" / PACKAGE / "planner" for prefix in _ament_prefixes()]
    if (Path(sys.prefix) / "lib" / PACKAGE).is_dir():
        # Not the one in lib, which leaves it to the environment which interpreter it is run by.
        executables.append(Path(sys.executable).parent / "planner")
    executable = next((file for file in executables if os.access(file, os.X_OK)), None)
    return [str(executable)] if executable else [sys.executable, "-m", f"{PACKAGE}.node"]
