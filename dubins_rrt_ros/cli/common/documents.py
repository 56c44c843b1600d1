"""Files that commands read: text and JSON, refused in one line where they are none."""

import json
from pathlib import Path
from typing import Any

from .parser import UsageError


def read_json(file: str) -> Any:
    """Read a JSON file.

    Raises:
        UsageError: it cannot be read, or is no JSON.
    """
    try:
        return json.loads(read_text(file))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{file} is no JSON file: {error}") from error


def read_text(file: str) -> str:
    """Read a text file.

    Raises:
        UsageError: it cannot be read, or is no text.
    """
    try:
        return Path(file).read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{file} is no text file: {error}") from error
