"""Errors of maps and of their files."""

from ..errors import PlanningError


class MapError(PlanningError, ValueError):
    """A map that cannot be used; the message names what is wrong and the remedy."""


class MapNotFound(MapError):
    """A map file, or the image that it names, that is not there or cannot be opened as a file."""


class MapMetadataError(MapError):
    """An error in the description of a grid, not in its cells: in its YAML, resolution or origin."""
