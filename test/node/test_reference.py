"""What docs/reference.md says of the node: its client, as it stands there, and its tables."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from dubins_rrt_ros.node.conversions import status_message
from dubins_rrt_ros.planning import Status

REFERENCE = (Path(__file__).resolve().parents[2] / "docs/reference.md").read_text("utf-8")
#: What every node of rclpy has, and one that listens to transforms, by the last part of its name.
OF_EVERY_NODE = {"parameter_events", "rosout", "clock", "tf", "tf_static", "describe_parameters", "get_parameter_types",
                 "get_parameters", "list_parameters", "set_parameters", "set_parameters_atomically", "get_type_description"}
#: What it has besides where messages are installed that PyPI does not have, which docs/nav2.md and the prose tell of.
OF_INSTALLATIONS = {"is_path_valid", "map_updates"}


def table(*columns):
    """The cells of each row of the table whose first columns have these headings."""
    head = re.escape(f"| {' | '.join(columns)} |")
    found = re.search(rf"^{head}.*\n\|[-|: ]+\n((?:\|.*\n)+)", REFERENCE, re.MULTILINE)
    assert found, f"docs/reference.md has no table with the columns {', '.join(columns)}"
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in found[1].splitlines()]


def test_the_example_client_gets_its_path(planners):
    block = re.search(r"<!-- example client -->\n```python\n(.*?)```", REFERENCE, re.DOTALL)
    process = planners.start(map_file="maze", seed=1)
    process.wait_until_ready()
    namespace = process.name.removesuffix("/planner")
    done = subprocess.run([sys.executable, "-c", block[1], "--ros-args", "-r", f"__ns:={namespace}"],
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"Path of \d\d\.\d\d m.* [1-9]\d\d poses\n", done.stdout), done.stdout + process.output


def test_the_table_of_parameters_is_the_one_that_is_printed(planners):
    process = planners.start("--", "--parameter-table")
    assert process.wait() == 0
    written = re.findall("<!-- parameters -->\n(.*?)<!-- end of parameters -->", REFERENCE, re.DOTALL)
    remedy = "put what `planner --parameter-table` prints between <!-- parameters --> and <!-- end of parameters -->"
    assert [table.strip() for table in written] == [process.output.strip()], remedy


def test_the_table_of_error_codes_is_that_of_the_statuses():
    rows = [(codes.split(", "), names.split(", ")) for codes, names, *_ in table("code", "name")]
    told = {int(code): name for codes, names in rows for code, name in zip(codes, names, strict=True)}
    assert told == {int(status): status.name for status in Status}


def test_the_table_of_status_keys_is_what_a_status_has():
    told = [key.strip("`") for keys, *_ in table("key", "value") for key in keys.split(", ")]
    has = [value.key for value in status_message("/planner", Status.NO_MAP, "").values]
    assert sorted(told) == sorted(has)


@pytest.mark.slow
def test_the_table_of_topics_and_services_is_what_a_running_node_has(planners):
    told = {(direction, name.strip("`"), kind) for direction, name, kind, *_ in table("direction", "name", "type")}
    has = set()
    for parameters, other_map in (({"map_file": "block"}, ("in", "map")), ({}, ("out", "map"))):
        planners.start(**parameters)
        client, wanted = planners.client(), {row[:2] for row in told} - {other_map}
        client.wait_for(lambda client=client, wanted=wanted: {row[:2] for row in names_of(client.node)} >= wanted,
                        f"node that has all of {sorted(wanted)}")
        has |= names_of(client.node)
    assert has == told


def names_of(node):
    """Direction, name and type of all that the planner in a client's namespace has, as the reference writes them."""
    if ("planner", node.get_namespace()) not in node.get_node_names_and_namespaces():
        return set()  # not yet
    looks = {"in": node.get_subscriber_names_and_types_by_node, "out": node.get_publisher_names_and_types_by_node,
             "service": node.get_service_names_and_types_by_node}
    return {(direction, written(name, node.get_namespace()), re.sub("/(msg|srv)/", "/", kind))
            for direction, look in looks.items() for name, (kind,) in look("planner", node.get_namespace())
            if name.rpartition("/")[2] not in OF_EVERY_NODE | OF_INSTALLATIONS and "/_action/" not in name}


def written(name, namespace):
    """A name without the node's namespace, and without its own name."""
    name = name.removeprefix(f"{namespace}/")
    return name.replace("planner/", "~/", 1) if name.startswith("planner/") else name
