"""Map files written for a test, and the messages with which they are refused."""

import pytest

from dubins_rrt_ros.planning.maps.errors import MapError
from dubins_rrt_ros.planning.maps.files import load_map
from support.images import pgm

FIELDS = {"image": "m.pgm", "resolution": "0.05", "origin": "[0, 0, 0]", "negate": "0",
          "occupied_thresh": "0.65", "free_thresh": "0.196"}
REMEDIES = ("give", "save", "correct", "name ", "make", "convert", "crop", "copy", "split", "mark", "choose")


def yaml_of(fields):
    return "".join(f"{key}: {value}\n" for key, value in fields.items() if value is not None)


def write_grid(folder, rows=((254, 0, 205),), name="m.pgm", **changes):
    """Write a pair and return the YAML's path; a field that is changed to None is left out."""
    (folder / name).write_bytes(pgm(rows))
    (folder / "m.yaml").write_text(yaml_of({**FIELDS, "image": name, **changes}), "utf-8")
    return folder / "m.yaml"


def image_named(folder, value):
    path = write_grid(folder)
    path.write_text(yaml_of({**FIELDS, "image": value}), "utf-8")
    return path


def refusal(path, kind=MapError, **options):
    """The message of a refusal of a kind, that must be one printable line with the file's name and a remedy."""
    with pytest.raises(MapError) as caught:
        load_map(path, **options)
    assert type(caught.value) is kind
    message = str(caught.value)
    assert message.isprintable()
    assert message.startswith(f"{path}: ") and message.count(str(path)) == 1
    assert any(word in message.split("; ")[-1] for word in REMEDIES), message
    return message
