"""`--scheduler`: the workers of a Dask cluster plan the same as this process, also where one of them dies at it."""

import json
import os
import signal
import threading
import time
from pathlib import Path

import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.cli.common.cluster import connected
from dubins_rrt_ros.cli.common.parser import UsageError
from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.evaluation.paper.runs import all_runs, measure, outcomes_on_cluster

pytestmark = [pytest.mark.slow, needs_compiled]
distributed = pytest.importorskip("distributed")

HALL = "POLYGON ((-6 -5, -1 -5, -1 1, 0 1, 0 -5, 6 -5, 6 5, -6 5, -6 -5))"
PROBLEM = {"name": "hall", "map": "hall.wkt", "start": [-4, -3, 1.57], "goal": [3.5, -3, -1.57], "turning_radius": 1.0,
           "robot_radius": 0.2}
SEEDS = 10


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local:
        yield local


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with a map and a problem."""
    monkeypatch.chdir(tmp_path)
    Path("hall.wkt").write_text(HALL)
    Path("problems.json").write_text(json.dumps([PROBLEM]))


def lines(file):
    return [json.loads(line) for line in Path(file).read_text().splitlines()]


def kill_a_worker_once_there_is_a_line(cluster, file, done):
    """Note the number of lines when a worker is killed; the others are queued or under way then."""
    with distributed.Client(cluster, set_as_default=False) as client:
        process = next(iter(client.run(os.getpid).values()))
        for _ in range(60_000):
            if Path(file).exists() and (count := Path(file).read_text().count("\n")):
                os.kill(process, signal.SIGKILL)
                done.append(count)
                break
            time.sleep(0.001)


def test_bench_has_the_same_paths_though_a_worker_is_killed(cluster, capsys):
    flags = ["bench", "problems.json", "--samples", "600", "--seeds", str(SEEDS)]
    assert main([*flags, "--out", "here.jsonl"]) == 0
    done = []
    killer = threading.Thread(target=kill_a_worker_once_there_is_a_line, args=(cluster, "there.jsonl", done), daemon=True)
    killer.start()
    assert main([*flags, "--out", "there.jsonl", "--scheduler", cluster.scheduler_address]) == 0
    killer.join()
    here, there = lines("here.jsonl"), sorted(lines("there.jsonl"), key=lambda line: line["seed"])
    assert done[0] < SEEDS, "all was done before the worker was killed"
    same = "seed", "path", "final_cost", "samples", "vertices"
    assert [[line[name] for name in same] for line in there] == [[line[name] for name in same] for line in here]
    assert all(line["host"] and line["cluster"] for line in there) and not any("host" in line for line in here)
    capsys.readouterr()
    assert main(["bench", "--report", "there.jsonl"]) == 0
    *_, row = capsys.readouterr().out.splitlines()
    _, solved, first, cost, *at, final, five, two, one = row.strip(" |").split(" | ")
    assert solved == f"{SEEDS}/{SEEDS}" and {first, *at, five, two, one} == {"-"}
    assert float(cost) >= float(final.split()[0]) > 0


def test_campaign_and_paper_have_the_same_results(cluster):
    flags = ["campaign", "--problems", "3", "--first", "50"]
    assert main([*flags, "--out", "here.jsonl"]) == main([*flags, "--out", "there.jsonl",
                                                          "--scheduler", cluster.scheduler_address]) == 0
    here, there = lines("here.jsonl"), sorted(lines("there.jsonl"), key=lambda line: line["number"])
    same = "number", "kind", "status", "edges", "length", "findings"
    assert [[line[name] for name in same] for line in there] == [[line[name] for name in same] for line in here]
    runs = all_runs(1)[:2]
    measured = {run: (outcome, where) for run, outcome, where in outcomes_on_cluster(runs, cluster.scheduler_address)}
    for run in runs:
        outcome, where = measured[run]
        assert outcome.without_times() == measure(run)[1].without_times() and where["host"] and where["cluster"]


def test_a_map_is_sent_once_to_a_worker(cluster):
    with connected(cluster.scheduler_address) as connection:
        shared = connection.share([1, 2, 3])
        # A function of this function: a worker cannot import this module.
        found = list(connection.run(lambda number, value: (number, os.getpid(), id(value)),
                                    [(number, shared) for number in range(20)], when_lost=None))
    assert sorted(number for number, _, _ in found) == list(range(20))
    assert len({(process, of_value) for _, process, of_value in found}) == len({process for _, process, _ in found})


@pytest.mark.parametrize(("flags", "says"), [
    (["--scheduler", "tcp://127.0.0.1:9"], "no Dask scheduler answers at tcp://127.0.0.1:9"),
    (["--scheduler", "tcp://127.0.0.1:9", "--jobs", "2"], "not allowed with argument"),
    (["--scheduler", "tcp://127.0.0.1:9", "--deadlines"], "measure this machine; leave --scheduler out")])
def test_what_cannot_be_is_refused(flags, says, capsys, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.cli.common.cluster.CONNECTION_TIME", 0.2)
    try:
        status = main(["bench", "problems.json", "--out", "runs.jsonl", *flags])
    except SystemExit as end:
        status = end.code
    assert status == 2 and says in capsys.readouterr().err


def test_another_version_on_a_worker_is_refused(cluster, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.cli.common.cluster.__version__", "9.9")
    with pytest.raises(UsageError, match="install the same on all"), connected(cluster.scheduler_address):
        pass
