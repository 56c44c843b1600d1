"""Record what the planner answers to some 60 requests, bit for bit, and check that it still does.

    python test/golden/record.py --write test/golden/record.json
    python test/golden/record.py --check test/golden/record.json

The paths are the shortest. With `--preferred-clearance -1` they keep room to the obstacles; record_room.json is of these.

Paths and trees are kept as hashes, with their length and size. Compiled kernels only, and on one machine: other libraries of C or
NumPy may round otherwise. A change that alters paths on purpose writes the record anew, in a commit of its own.
"""

import argparse
import hashlib
import json
import platform
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy
import shapely
from requests import REQUESTS, Request

from dubins_rrt_ros.planning import Plan, Problem, Settings, Vehicle, kernels_compiled, load_map, plan

OWN_MAPS = Path(__file__).resolve().parents[2] / "maps"
#: Tree arrays that are hashed, in this order.
TREE_ARRAYS = "poses", "parents", "costs", "words", "lengths"


def main() -> int:
    """Run the command line; return 0 where all is as recorded, 1 where something differs, 2 where nothing can be said."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", metavar="FILE", type=Path, help="plan all requests and record the answers")
    what.add_argument("--check", metavar="FILE", type=Path, help="plan all requests and compare with a record")
    parser.add_argument("--peers", metavar="DIR", type=Path, default=None,
                        help="folder with maps of other projects, maps/NAME.yaml in it; requests on them are left out without it")
    parser.add_argument("--preferred-clearance", metavar="m", type=float, default=0.0,
                        help="of all requests but those that are not informed; default 0, the shortest paths")
    arguments = parser.parse_args()
    if not kernels_compiled:
        print("The kernels are interpreted; the record is of compiled ones: python setup.py build_ext --inplace", file=sys.stderr)
        return 2
    requests = [request for request in REQUESTS if _map_file(request, arguments.peers)]
    if len(requests) < len(REQUESTS):
        print(f"{len(REQUESTS) - len(requests)} requests left out: their maps are not at hand (--peers DIR)")
    with ProcessPoolExecutor(2) as pool:
        answers = dict(zip((request.name for request in requests),
                           pool.map(partial(_answer, peers=arguments.peers, preferred=arguments.preferred_clearance), requests,
                                    chunksize=1), strict=True))
    if arguments.write:
        arguments.write.write_text(json.dumps({"made with": _machine(), "answers": answers}, indent=1) + "\n")
        print(f"{len(answers)} answers written to {arguments.write}")
        return 0
    return _compare(json.loads(arguments.check.read_text()), answers)


def _compare(record: dict[str, Any], answers: dict[str, Any]) -> int:
    if record["made with"] != _machine():
        print(f"The record was made with {record['made with']}, this is {_machine()}: bits may differ.")
    differences = 0
    for name, answer in answers.items():
        expected = record["answers"].get(name)
        if answer != expected:
            differences += 1
            print(f"{name}: recorded {expected}, now {answer}")
    forgotten = sorted(set(record["answers"]) - {request.name for request in REQUESTS})
    if forgotten:
        print(f"recorded but no longer asked: {', '.join(forgotten)}")
    print(f"{len(answers)} answers compared, {differences} differ")
    return 1 if differences or forgotten or not answers else 0


def _answer(request: Request, peers: Path | None, preferred: float) -> dict[str, Any]:
    """The answer to a request, in figures and hashes."""
    world_map = load_map(_map_file(request, peers))
    problem = Problem(world_map, Vehicle(**request.vehicle), request.start, request.goal, **request.problem)
    result = plan(problem, Settings(planning_time=3600.0, preferred_clearance=preferred, **request.settings))
    length = repr(float(result.path.length)) if result.path else None
    return {"status": result.status.name, "samples": int(result.samples), "nodes": len(result.tree), "length": length,
            "path": _path_hash(result), "tree": _tree_hash(result)}


def _path_hash(result: Plan) -> str | None:
    if result.path is None:
        return None
    digest = hashlib.sha256(np.array([*result.path.start, *result.path.end], float).tobytes())
    for curve in result.path.curves:
        digest.update(curve.word.encode())
        digest.update(np.array([*curve.start, curve.radius, *curve.lengths], float).tobytes())
    return digest.hexdigest()[:16]


def _tree_hash(result: Plan) -> str:
    digest = hashlib.sha256()
    for name in TREE_ARRAYS:
        digest.update(np.ascontiguousarray(getattr(result.tree, name), float).tobytes())
    return digest.hexdigest()[:16]


def _map_file(request: Request, peers: Path | None) -> Path | None:
    """Where the map of a request is, or None where it is not at hand."""
    folder, _, name = request.map.partition(":")
    file = OWN_MAPS / name if folder == "own" else peers / name if peers else None
    return file if file and file.is_file() else None


def _machine() -> dict[str, str]:
    return {"machine": platform.machine(), "python": platform.python_version(), "numpy": np.__version__,
            "scipy": scipy.__version__, "shapely": shapely.__version__}


if __name__ == "__main__":
    sys.exit(main())
