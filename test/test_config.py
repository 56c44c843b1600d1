"""The files in config/: RViz and Foxglove show and send what the node publishes and hears."""

import json
from pathlib import Path

import pytest
import yaml

CONFIG = Path(__file__).resolve().parent.parent / "config"
#: Topics of a node without a namespace, and the displays that show them.
OUTPUTS = {"/map": "Map", "/planner/tree": "MarkerArray", "/plan": "Path"}
#: The tools that publish to the node.
INPUTS = {"/initialpose": "SetInitialPose", "/goal_pose": "SetGoal"}


@pytest.fixture(scope="module")
def rviz():
    """RViz's view as a dictionary."""
    return yaml.safe_load((CONFIG / "planner.rviz").read_text("utf-8"))


def by_topic(items):
    """(class, topic) of the displays or tools that have one, by the topic's name."""
    return {item["Topic"]["Value"]: (item["Class"], item["Topic"]) for item in items if "Topic" in item}


def test_the_displays_show_what_the_node_publishes(rviz):
    shown = by_topic(rviz["Visualization Manager"]["Displays"])
    assert {topic: kind for topic, (kind, _) in shown.items()} == {
        topic: f"rviz_default_plugins/{display}" for topic, display in OUTPUTS.items()}
    for topic, (_, described) in shown.items():
        assert (described["Durability Policy"], described["Reliability Policy"]) == ("Transient Local", "Reliable"), topic


def test_the_tools_publish_what_the_node_hears(rviz):
    sent = by_topic(rviz["Visualization Manager"]["Tools"])
    assert {topic: kind for topic, (kind, _) in sent.items()} == {
        topic: f"rviz_default_plugins/{tool}" for topic, tool in INPUTS.items()}
    assert all(described["Reliability Policy"] == "Reliable" for _, described in sent.values())


def test_the_view_looks_down_on_the_frame_of_the_map(rviz):
    manager = rviz["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == "map"
    assert manager["Views"]["Current"]["Class"] == "rviz_default_plugins/TopDownOrtho"
    assert {panel["Class"] for panel in rviz["Panels"]} == {"rviz_common/Displays", "rviz_common/Views"}


def test_every_display_is_switched_as_its_value_says(rviz):
    """RViz keeps the two alike."""
    for display in rviz["Visualization Manager"]["Displays"]:
        assert display["Enabled"] == display["Value"], display["Name"]


def test_foxglove_shows_and_sends_the_same():
    layout = json.loads((CONFIG / "foxglove.json").read_text("utf-8"))
    scene, status = layout["configById"]["3D!planner"], layout["configById"]["RawMessages!status"]
    assert set(scene["topics"]) == set(OUTPUTS)
    assert {scene["publish"]["poseTopic"], scene["publish"]["poseEstimateTopic"]} == set(INPUTS)
    assert status["topicPath"] == "/planner/status"
    assert {layout["layout"]["first"], layout["layout"]["second"]} == set(layout["configById"])
