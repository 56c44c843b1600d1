"""`dubins_rrt certify` and `check`, and `plan --certificate`, on the command line."""

import contextlib
import io

import numpy as np
import pytest
from PIL import Image
from support.cases import needs_compiled
from support.images import saved
from support.map_files import write_grid

from dubins_rrt_ros.cli import main as program

ENDS = ["--start", "2", "2", "0", "--goal", "4", "2", "0"]
NO_SEARCH = ["--samples", "1", "--preferred-clearance", "0"]


def refusal(*words, capsys):
    """The one line on standard error of a command that is used wrongly, and writes nothing to standard output."""
    assert program.main(words) == 2
    out, error = capsys.readouterr()
    assert out == "" and error.count("\n") == 1
    return error


@needs_compiled
def test_a_certificate_is_written_and_checked(tmp_path, capsys):
    room = str(write_grid(tmp_path, np.full((60, 60), 254, np.uint8), resolution=0.1))
    assert program.main(["certify", room, *ENDS, *NO_SEARCH, "--out", str(tmp_path / "path.cert")]) == 0
    assert program.main(["check", str(tmp_path / "path.cert"), room]) == 0
    assert "no path is shorter than 2.0000 m" in capsys.readouterr().out.splitlines()[-1]
    assert program.main(["check", str(tmp_path / "path.cert"), "maze"]) == 1
    assert "does not hold: the map is not the one" in capsys.readouterr().err


@pytest.mark.parametrize(("options", "said"), [
    (["--start-slack", "0.1"], "leave start_slack out"), (["--via", "3", "2"], "leave --via out")], ids=["start_slack", "via"])
def test_requests_without_certificates_are_refused_before_they_are_planned(options, said, tmp_path, capsys):
    file = tmp_path / "path.cert"
    assert said in refusal("plan", "block", *ENDS, *options, "--certificate", str(file), capsys=capsys) and not file.exists()


def test_pictures_are_refused_before_a_plan(tmp_path, capsys):
    (tmp_path / "room.png").write_bytes(saved(Image.new("L", (60, 60), 255)))
    said = refusal("plan", str(tmp_path / "room.png"), "--resolution", "0.1", *ENDS, "--certificate", str(tmp_path / "path.cert"),
                   capsys=capsys)
    assert "states no thresholds; give a map_server YAML file" in said


def test_greys_that_are_read_otherwise_are_refused_before_a_plan(tmp_path, capsys):
    rows = np.full((60, 60), 254, np.uint8)
    rows[0] = 0
    room = write_grid(tmp_path, rows, resolution=0.1)
    said = refusal("plan", str(room), "--unknown-grey", "0", *ENDS, "--certificate", str(tmp_path / "path.cert"), capsys=capsys)
    assert "leave unknown_grey out" in said


def test_certify_offers_no_flags_that_would_fail():
    with contextlib.redirect_stdout(io.StringIO()) as out, pytest.raises(SystemExit):
        program.main(["certify", "--help"])
    assert "--gap" in out.getvalue()
    assert not any(flag in out.getvalue() for flag in ("--via", "--resolution", "--unknown-grey", "--start-slack"))


@pytest.mark.parametrize(("certificate", "said"), [
    ("nowhere.cert", "'nowhere.cert' cannot be read: No such file or directory"),
    (".", "'.' cannot be read: Is a directory"), ("", "'' cannot be read: No such file or directory")])
def test_a_certificate_that_cannot_be_read_is_named(certificate, said, capsys):
    assert refusal("check", certificate, "maze", capsys=capsys) == f"dubins_rrt check: error: {said}\n"
