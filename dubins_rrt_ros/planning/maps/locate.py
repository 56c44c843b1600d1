"""The search for map files: by path, by URL, or by the name of a map of the package, however that was installed."""

import os
import re
import sys
from pathlib import Path
from urllib.parse import unquote

from .errors import MapNotFound
from .opening import expand_home
from .readers import MAP_ENDINGS

PACKAGE = "dubins_rrt_ros"
#: The ending that the name of an installed map may leave out.
OMITTED_ENDING = ".yaml"
_URL = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]*)://(?P<host>[^/]*)/?(?P<path>.*)", re.DOTALL)


def ament_prefixes() -> list[Path]:
    """List the prefixes to which colcon and apt may have installed packages."""
    return [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def _share_folders(package: str) -> list[Path]:
    """List the folders where a package's shared files may be: of colcon or apt; for our own also of pip and the source tree."""
    folders = [prefix / "share" / package for prefix in ament_prefixes()]
    if package == PACKAGE:
        folder = Path(__file__).resolve().parents[2]
        # Above lib/python3.12/site-packages/dubins_rrt_ros: of a workspace, too, that was not sourced.
        prefixes = [*folder.parents[3:4], Path(sys.prefix)]
        folders += [*(prefix / "share" / package for prefix in prefixes), folder.parent]
    return folders


def maps_directory() -> Path:
    """Return the folder of the package's own maps: in the share folder (of colcon or apt, then of pip), or the source tree."""
    folders = [folder / "maps" for folder in _share_folders(PACKAGE)]
    return next((folder for folder in folders if folder.is_dir()), folders[-1])


def installed_maps() -> list[Path]:
    """List the files of the package's own maps by name."""
    return sorted(file for file in maps_directory().glob("*") if file.suffix in MAP_ENDINGS)


def find_map(name: str) -> Path:
    """Return the file of a map.

    Args:
        name: a path, where a leading `~` is the home directory; the name of one of the package's own maps, with or
            without its ending; or a URL, `file:///PATH` or `package://PACKAGE/PATH IN ITS SHARE FOLDER`.

    Raises:
        MapNotFound: there is none.
    """
    url = _URL.fullmatch(name)
    places = [_path_of(url)] if url else _places(name)
    # pathlib's is_file() raises for names that are too long or in a folder that is closed to us.
    path = next(filter(os.path.isfile, places), None)
    if path is None:
        raise MapNotFound(f"{name}: {no_folder(places[0]) or f'no such map file; give {_choices()}'}")
    return path


def find_own(path: str | os.PathLike[str]) -> Path:
    """Return a path, its leading `~` replaced; the file of a URL; or one of the package's own maps, if it alone has that name."""
    if isinstance(path, str) and (url := _URL.fullmatch(path)):
        return _path_of(url)
    return next(filter(os.path.isfile, _places(path)), expand_home(path))


def installed_map(name: str) -> Path | None:
    """Return the file of one of the package's own maps, by its name with or without the ending; None where there is none."""
    return next(filter(os.path.isfile, _places(name)[1:]), None)


def no_folder(path: Path) -> str:
    """Return what is wrong with a folder that is named as a map; "" where it is none."""
    return f"is a directory; give the map file in it ({', '.join(MAP_ENDINGS)})" if os.path.isdir(path) else ""


def _choices() -> str:
    own = [file.name for file in installed_maps()]
    return ("a path, a file:// or package:// URL, or one of the package's own maps: "
            f"{', '.join(own) or 'none are installed'}")


def _places(name: str | os.PathLike[str]) -> list[Path]:
    """List the files that a name which is no URL may stand for."""
    if not os.fspath(name):
        raise MapNotFound(f"the name of the map is empty; give {_choices()}")
    path, own = expand_home(name), maps_directory()
    is_own = path.parent in (Path("."), Path("maps"))
    return [path, own / path.name, own / f"{path.name}{OMITTED_ENDING}"] if is_own else [path]


def _path_of(url: re.Match[str]) -> Path:
    path = unquote(url["path"], errors="surrogateescape")
    try:
        match url["scheme"].lower():
            case "file":
                return _local_path(url["host"], path)
            case "package":
                return _package_path(url["host"], path)
        raise MapNotFound(f"maps are not read by {url['scheme']}://; give a file:// or package:// URL, or a path")
    except MapNotFound as error:
        raise MapNotFound(f"{url[0]}: {error}") from None


def _local_path(host: str, path: str) -> Path:
    if host.lower() not in ("", "localhost"):
        raise MapNotFound(f"maps are not read from the host {host!r}; give file:///PATH, with three slashes")
    return Path("/", path)


def _package_path(package: str, path: str) -> Path:
    if not re.fullmatch(r"\w[\w-]*", package) or Path(path).is_absolute() or ".." in Path(path).parts:
        raise MapNotFound("names no file within a package's share folder; give package://PACKAGE/PATH, without '..'")
    # package.xml is what every share folder holds, and the source tree, but not where pip puts our modules.
    share = next((folder for folder in _share_folders(package) if os.path.isfile(folder / "package.xml")), None)
    if share is None:
        raise MapNotFound(f"no package {package} in AMENT_PREFIX_PATH; correct its name, or source the workspace that has it")
    return share / path
