"""Work on the workers of a Dask cluster: what commands with `--scheduler ADDRESS` do."""

import argparse
import contextlib
import socket
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import Executor, as_completed
from typing import TYPE_CHECKING, Any

from dubins_rrt_ros import __version__

from .parser import UsageError

if TYPE_CHECKING:
    from distributed import Client

#: Maximum time to wait for the scheduler, and then for its first worker [s].
CONNECTION_TIME = 10.0
#: A map is sent whatever its size; by default Dask warns of more than ten megabytes.
_DASK = {"distributed.admin.large-graph-warning-threshold": "1 TiB"}


def add_jobs_flags(group: argparse._MutuallyExclusiveGroup, jobs_help: str) -> None:
    """Give a group the flags --jobs and --scheduler, of which one may be given."""
    group.add_argument("--jobs", metavar="N", type=int, help=jobs_help)
    group.add_argument("--scheduler", metavar="ADDRESS",
                       help="address of a Dask cluster whose workers do it in place of processes here, such as "
                            "tcp://host:8786; the same seeds give the same paths, and times stay out of the tables")


class Cluster:
    """The workers of a Dask cluster, on which this package is installed in the same version."""

    def __init__(self, client: "Client"):
        self._client = client

    def share(self, value: Any) -> Any:
        """Return a stand-in for a value among the arguments of work; a worker gets it once, with its first such work.

        The scheduler keeps it, so that no end of a worker loses it.
        """
        return self._client.submit(_same, value, pure=False)

    def run(self, work: Callable[..., Any], calls: Iterable[tuple[Any, ...]], when_lost: Callable[[tuple[Any, ...], str], Any]
            ) -> Generator[Any, None, None]:
        """Yield what `work` returns for the arguments of each call, in any order and each once.

        Args:
            work: a function of a module.
            when_lost: makes the result of a call that ended several workers, from it and a sentence on what happened.
        """
        from distributed import KilledWorker
        executor: Executor = self._client.get_executor(pure=False)
        futures = {executor.submit(work, *call): call for call in calls}
        try:
            for future in as_completed(futures):
                try:
                    result = future.result()
                except KilledWorker:
                    result = when_lost(futures[future], "every worker that tried it died")
                yield result
        finally:
            executor.shutdown(wait=False)  # what is not done is cancelled


@contextlib.contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """Connect to the cluster of a scheduler.

    Raises:
        UsageError: Dask is not installed, nothing answers there, it has no workers, or one has not this version.
    """
    try:
        import dask
        from distributed import Client
    except ImportError:
        raise UsageError("--scheduler needs Dask; run: pip install 'dubins_rrt_ros[cluster]'") from None
    with dask.config.set(_DASK), contextlib.ExitStack() as stack:
        try:
            client = stack.enter_context(Client(address, timeout=CONNECTION_TIME, set_as_default=False))
        except (OSError, ValueError) as error:
            raise UsageError(f"no Dask scheduler answers at {address}: {str(error) or type(error).__name__}") from None
        try:
            client.wait_for_workers(1, CONNECTION_TIME)
            _check_versions(client.run(_version))
        except TimeoutError:
            raise UsageError(f"the cluster at {address} has no workers; start some: dask worker {address}") from None
        except ImportError as error:
            raise UsageError(f"a worker of the cluster lacks a package: {error}; install this one there") from None
        yield Cluster(client)


def place() -> dict[str, Any]:
    """Return the fields of a line that was measured by a worker: its host, and that times are not to be compared."""
    return {"host": socket.gethostname(), "cluster": True}


def _check_versions(versions: Mapping[str, str]) -> None:
    others = {worker: version for worker, version in versions.items() if version != __version__}
    for worker, version in others.items():
        raise UsageError(f"the worker {worker} has version {version} of this package, and this is {__version__}; "
                         "install the same on all")


def _version() -> str:
    return __version__


def _same(value: Any) -> Any:
    return value
