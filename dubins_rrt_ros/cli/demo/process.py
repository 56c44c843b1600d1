"""The installed planner node as a process, and the command that starts it."""

import contextlib
import importlib.util
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from dubins_rrt_ros.planning.maps.locate import PACKAGE, ament_prefixes
from dubins_rrt_ros.planning.text import install_command

#: Time limit for the node to stop [s].
STOP_TIME = 10.0


class DemoError(Exception):
    """A failure of the node or its client; the message says where, and what to do."""


class PlannerProcess:
    """The installed node in a process group of its own, whose log is kept for the message of a failure."""

    def __init__(self, parameters: Mapping[str, Any], log: IO[str]):
        assignments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        self._log = log
        self._process = subprocess.Popen([*planner_command(), "--ros-args", *assignments], stdin=subprocess.DEVNULL,
                                         stdout=log, stderr=subprocess.STDOUT, start_new_session=True)

    def check(self) -> None:
        """Raise DemoError if the node has ended."""
        status = self._process.poll()
        if status is not None:
            raise DemoError(f"the node ended with exit status {status}: {self._last_line()}")

    @property
    def cpu_time(self) -> float:
        """The CPU time that all its threads have used [s]."""
        tasks = Path(f"/proc/{self._process.pid}/task").iterdir()
        return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks) / 1e9

    def stop(self) -> int:
        """End the node as Ctrl-C does, and return its exit status."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGINT)
            try:
                self._process.wait(STOP_TIME)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
        return self._process.wait()

    def _last_line(self) -> str:
        self._log.seek(0)
        lines = [line for line in self._log.read().splitlines() if line.strip()]
        return lines[-1] if lines else "it said nothing"


def enter_domain() -> None:
    """Let this process and its children hear nobody but each other: no robot nearby may receive a goal.

    Raises:
        DemoError: ROS is not here.
    """
    if importlib.util.find_spec("rclpy") is None:
        raise DemoError(f"ROS 2 is not here (no module rclpy); run: {install_command('ros')}")
    os.environ |= {"ROS_DOMAIN_ID": str(1 + os.getpid() % 101), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@contextlib.contextmanager
def running_planner(parameters: Mapping[str, Any]) -> Iterator[PlannerProcess]:
    """Run the node with these parameters."""
    # SIGTERM ends this process as Ctrl-C does, so that no node is left behind.
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    planner = None
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as log:
        try:
            with _interrupts_deferred():
                planner = PlannerProcess(parameters, log)
            yield planner
        finally:
            if planner:
                planner.stop()
            signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """Let an interruption wait: within Popen it would leave a process that nobody knows."""
    came: list[int] = []
    before = {number: signal.signal(number, lambda number, _: came.append(number)) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if came:
        raise KeyboardInterrupt


def planner_command() -> list[str]:
    """Return the command that starts the node: the executable of colcon or apt, that of pip, or the source tree's module."""
    executables = [prefix / "lib" / PACKAGE / "planner" for prefix in ament_prefixes()]
    if (Path(sys.prefix) / "lib" / PACKAGE).is_dir():
        # Not the one in lib, which leaves it to the environment which interpreter it is run by.
        executables.append(Path(sys.executable).parent / "planner")
    executable = next((file for file in executables if os.access(file, os.X_OK)), None)
    return [str(executable)] if executable else [sys.executable, "-m", f"{PACKAGE}.node"]
