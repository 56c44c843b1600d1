"""README.md and the manual in docs/: their commands and programs run as printed, and what they point at is there.

A block in the language `sh` is run as one script, in a copy of the source tree that the blocks of its page share, and one in
`python` as one program. The line before a block may say `<!-- not run: REASON -->`.
"""

import contextlib
import importlib.util
import io
import os
import re
import shutil
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

import pytest
from support.cases import needs_compiled
from support.domains import claim_domain

import dubins_rrt_ros
from dubins_rrt_ros.cli.main import main

ROOT = Path(__file__).resolve().parent.parent
PAGES = ["README.md", *sorted(page.relative_to(ROOT).as_posix() for page in ROOT.glob("docs/**/*.md"))]
#: Marks of blocks that others run: .ci/run, and test/node/test_reference.py.
RUN_ELSEWHERE = ("quick start", "example client")
#: How a block is run, by its language.
INTERPRETERS = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}
#: Languages that could be run by nobody's notice.
OTHER_NAMES = {"bash", "shell", "console", "shell-session", "zsh", "py", "python3"}
#: The commands that the pages speak of, and the modules that they run.
COMMANDS = {"dubins_rrt": "dubins_rrt_ros", "planner": "dubins_rrt_ros.node"}
#: How long a block may take [s].
LIMIT = 120

FENCE = re.compile(r"^(?P<indent> *)```(?P<language>[\w-]*)[^\n]*\n(?P<text>.*?)^ *```$", re.MULTILINE | re.DOTALL)
MARK = re.compile(r"<!-- (.+) -->\n *\Z")
NEEDS_ROS = re.compile(r"\brclpy\b|^ *(planner|dubins_rrt demo)\b", re.MULTILINE)


class Block(NamedTuple):
    """A fenced block: where it begins, what it is written in, what it says, and the mark in the line before it or ""."""

    page: str
    line: int
    language: str
    text: str
    mark: str

    @property
    def is_run(self) -> bool:
        return self.language in INTERPRETERS and self.mark not in RUN_ELSEWHERE and not self.mark.startswith("not run: ")


@cache
def text_of(page):
    return (ROOT / page).read_text("utf-8")


def blocks(page):
    text = text_of(page)
    for found in FENCE.finditer(text):
        before = text[:found.start()]
        mark = MARK.search(before)
        lines = [line.removeprefix(found["indent"]) for line in found["text"].splitlines()]
        yield Block(page, 1 + before.count("\n"), found["language"], "\n".join(lines), mark[1] if mark else "")


BLOCKS = [block for page in PAGES for block in blocks(page)]
RUN = [block for block in BLOCKS if block.is_run]


def prose(page):
    """A page without its blocks."""
    return FENCE.sub("", text_of(page))


# What is run

@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Variables with which the blocks find the package that is tested, and no other ROS node."""
    commands = tmp_path_factory.mktemp("bin")
    for name, module in COMMANDS.items():
        (commands / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {module} "$@"\n')
        (commands / name).chmod(0o755)
    return os.environ | {
        "PATH": extended("PATH", commands, Path(sys.executable).parent),
        "PYTHONPATH": extended("PYTHONPATH", Path(dubins_rrt_ros.__file__).parent.parent), "PYTHONSAFEPATH": "1",
        "MPLBACKEND": "Agg", "ROS_LOG_DIR": str(tmp_path_factory.mktemp("log")),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(claim_domain())}


def extended(variable, *folders):
    """A list of folders in the environment, with others in front of it."""
    return os.pathsep.join([*map(str, folders), *filter(None, [os.environ.get(variable)])])


@pytest.fixture(scope="module")
def folder_of(tmp_path_factory):
    """The copy of the source tree in which the blocks of a page are run."""
    leave_out = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "*.so", "*.c", "build", "install", "log", "dist")

    @cache
    def copied(page):
        return shutil.copytree(ROOT, tmp_path_factory.mktemp("page") / "dubins_rrt_ros", ignore=leave_out)

    return copied


@pytest.mark.slow
@needs_compiled
@pytest.mark.parametrize("block", RUN, ids=[f"{block.page}:{block.line}" for block in RUN])
def test_a_block_runs_as_printed(block, environment, folder_of, tmp_path):
    if NEEDS_ROS.search(block.text) and importlib.util.find_spec("rclpy") is None:
        pytest.skip("rclpy is not installed")
    output = tmp_path / "output.txt"
    with output.open("w") as file:
        status = status_of(block, cwd=folder_of(block.page), env=environment, stdout=file, stderr=file)
    assert status == 0, f"{block.page}, line {block.line}:\n{block.text}\n--\n{output.read_text()}"


def status_of(block, **how):
    """The exit status of a block; what it leaves running is ended."""
    # `bash -e` goes on after what fails before a `&&`, but not at the end of a line.
    program = block.text.replace(" && ", "\n") if block.language == "sh" else block.text
    process = subprocess.Popen([*INTERPRETERS[block.language], program], stdin=subprocess.DEVNULL, start_new_session=True, **how)
    try:
        return process.wait(LIMIT)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_every_block_that_could_be_run_is_marked_as_such():
    assert [f"{block.page}:{block.line} {block.language}" for block in BLOCKS if block.language in OTHER_NAMES] == []
    assert RUN


# What is pointed at

LINK = re.compile(r"\]\(([^)\s]+)|^\[[^\]]+\]: *(\S+)|\b(?:src|href)=\"([^\"]+)\"", re.MULTILINE)


def headings(page):
    """The anchors of a page's headings, as GitHub makes them."""
    seen = {}
    for title in re.findall(r"^#+ +(.+?) *$", prose(page), re.MULTILINE):
        title = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title)
        anchor = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
        count = seen[anchor] = seen.get(anchor, -1) + 1
        yield f"{anchor}-{count}" if count else anchor


def is_there(page, target):
    name, _, anchor = unquote(target).partition("#")
    file = (ROOT / page).parent / name if name else ROOT / page
    if not file.resolve().is_relative_to(ROOT) or not file.exists():
        return False
    return not anchor or file.suffix != ".md" or anchor in headings(file.resolve().relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES)
def test_every_relative_link_leads_somewhere(page):
    shown = re.sub("`[^`]*`", "code", prose(page))
    targets = {next(filter(None, groups)) for groups in LINK.findall(shown)}
    relative = {target for target in targets if not re.match("[a-z]+:", target)}
    assert sorted(target for target in relative if not is_there(page, target)) == []


def test_every_page_has_its_place_in_the_manual():
    """Its links and its code are tested here, and that it is well formed by Sphinx, in .ci/run."""
    trees = re.findall(r"```{toctree}\n(.*?)```", text_of("docs/index.md"), re.DOTALL)
    placed = [f"docs/{entry}.md" for tree in trees for entry in re.findall(r"^[\w/]+$", tree, re.MULTILINE)]
    assert len(trees) == 4  # tutorial, how-to guides, reference, background
    assert sorted([*placed, "docs/index.md", "README.md"]) == sorted(PAGES)


@cache
def help_of(*command):
    """What a command prints as its help; in this process, but for the node's, which changes what signals do."""
    if command[0] == "dubins_rrt":
        with contextlib.redirect_stdout(io.StringIO()) as text, contextlib.suppress(SystemExit):
            main([*command[1:], "--help"])
        return text.getvalue()
    return subprocess.run([sys.executable, "-m", COMMANDS[command[0]], *command[1:], "--help"], capture_output=True, text=True,
                          timeout=LIMIT).stdout


def named_flags(page):
    """What the prose of a page says in code: a command, such as (dubins_rrt, bench), and a flag of it."""
    for code in re.findall("`([^`]+)`", prose(page)):
        program, *words = code.split()
        if program in COMMANDS and not (program == "planner" and importlib.util.find_spec("rclpy") is None):
            subcommand = [word for word in words[:1] if program == "dubins_rrt" and re.fullmatch("[a-z]+", word)]
            yield from ((program, *subcommand, flag) for flag in re.findall(r"(?<!\S)--[a-z-]+", " ".join(words)))


@pytest.mark.parametrize("page", PAGES)
def test_every_flag_of_ours_that_is_named_exists(page):
    unknown = [words for words in named_flags(page) if not re.search(rf"(?<![\w-]){words[-1]}(?![\w-])", help_of(*words[:-1]))]
    assert unknown == []


def test_the_manual_s_table_of_warnings_quotes_them():
    text = (ROOT / "docs/howto/troubleshooting.md").read_text()
    table = text.split("## It warns about what it was given", 1)[1].split("\n## ", 1)[0]
    firsts = [line.split("|")[1] for line in table.splitlines() if line.startswith('| "')]
    quoted = [words for first in firsts for words in re.findall(r'"([^"]+)"', first)]
    package = Path(dubins_rrt_ros.__file__).parent
    source = " ".join(file.read_text() for file in package.rglob("*.py"))
    assert len(quoted) > 10 and [words for words in quoted if words not in source] == []
