"""The planner in a process that is forked where everything is imported already, which spares each start most of its CPU time."""

import multiprocessing
import os
import sys
from multiprocessing.connection import Connection

_context = multiprocessing.get_context("forkserver")
_context.set_forkserver_preload(["dubins_rrt_ros.node.main"])


class ForkedPlanner:
    """The command `planner` with these arguments, to be used as a subprocess.Popen."""

    def __init__(self, arguments: list[str]):
        reader, writer = _context.Pipe(duplex=False)
        self._process = _context.Process(target=_run, args=(writer, arguments, dict(os.environ)))
        self._process.start()
        writer.close()
        self.stdout = os.fdopen(os.dup(reader.fileno()))
        reader.close()
        self.pid = self._process.pid

    def poll(self) -> int | None:
        """Return its exit status, where it has ended."""
        return self._process.exitcode

    def wait(self, timeout: float) -> int:
        """Return its exit status."""
        self._process.join(timeout)
        assert self._process.exitcode is not None, f"the node has not ended in {timeout} s"
        return self._process.exitcode

    def send_signal(self, by: int) -> None:
        """Send a signal, where it has not ended."""
        if self._process.is_alive():
            os.kill(self.pid, by)

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()


def _run(output: Connection, arguments: list[str], environment: dict[str, str]) -> None:
    for descriptor in (1, 2):
        os.dup2(output.fileno(), descriptor)
    output.close()
    sys.stdout.reconfigure(write_through=True)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["planner", *arguments]
    from dubins_rrt_ros.node.main import main

    sys.exit(main())
