"""What a release has to agree on: package.xml, setup.py, the package and CHANGELOG.rst."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import dubins_rrt_ros

ROOT = Path(__file__).resolve().parent.parent
CHANGELOG = (ROOT / "CHANGELOG.rst").read_text("utf-8")
#: The headings of the changelog's sections with their underlines, newest first.
HEADINGS = re.findall(r"^(\S.*)\n(-+)$", CHANGELOG, re.MULTILINE)


def in_package_xml(name):
    return ElementTree.parse(ROOT / "package.xml").findtext(name)


def in_setup(keyword):
    return re.search(rf'^    {keyword}="(.*)",$', (ROOT / "setup.py").read_text("utf-8"), re.MULTILINE)[1]


def test_the_version_is_the_same_everywhere():
    released = [heading for heading, _ in HEADINGS if heading != "Forthcoming"]
    assert released, 'CHANGELOG.rst has no version yet; give "Forthcoming" the form "0.1.0 (2026-11-23)", as bloom wants it'
    version = released[0].partition(" ")[0]
    assert version == in_package_xml("version") == in_setup("version") == dubins_rrt_ros.__version__
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()


def test_the_changelog_has_the_form_that_bloom_reads():
    title = "Changelog for package dubins_rrt_ros"
    assert CHANGELOG.startswith(f"{'^' * len(title)}\n{title}\n{'^' * len(title)}\n")
    for number, (heading, underline) in enumerate(HEADINGS):
        assert re.fullmatch(r"\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)", heading) or (number, heading) == (0, "Forthcoming")
        assert len(underline) == len(heading)


def test_package_xml_and_setup_agree():
    assert in_package_xml("name") == dubins_rrt_ros.__name__
    assert in_package_xml("description").startswith(in_setup("description"))
    for keyword in ("author", "maintainer", "license"):
        assert in_package_xml(keyword) == in_setup(keyword)


def test_nothing_is_claimed_that_is_not_tried():
    """Wheels are tried by .ci/packages, on Linux."""
    setup, packages = ((ROOT / name).read_text("utf-8") for name in ("setup.py", ".ci/packages"))
    tried = re.search(r"for version in ([\d. ]+);", packages)[1].split()
    assert re.findall(r'"Programming Language :: Python :: (.*?)"', setup) == tried
    assert re.findall(r'"Operating System :: (.*?)"', setup) == ["POSIX :: Linux"]
    builds = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["cibuildwheel"]["build"]
    assert builds == " ".join(f"cp{version.replace('.', '')}-*" for version in tried)


def test_a_linked_setup_reads_the_readme_of_its_source(tmp_path):
    """`colcon build --symlink-install` runs setup.py by a link from a folder of its own."""
    (tmp_path / "setup.py").symlink_to(ROOT / "setup.py")
    command = [sys.executable, "setup.py", "--quiet", "--long-description"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert (ROOT / "README.md").read_text("utf-8").strip() in done.stdout
