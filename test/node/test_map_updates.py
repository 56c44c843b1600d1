"""Changes of a map by the topic map_updates, through the executable."""

import array

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("map_msgs", reason="map_msgs is not here; .ci/messages builds it")

from map_msgs.msg import OccupancyGridUpdate
from support.walls import DETOUR, FREE, id_of, publish, walled

pytestmark = pytest.mark.messages


def update(cells, rows, columns):
    """The part of these cells in the rows and columns."""
    height, width = cells[rows, columns].shape
    message = OccupancyGridUpdate(x=columns.start, y=rows.start, width=width, height=height)
    message.header.frame_id = "map"
    message.data = array.array("b", np.ascontiguousarray(cells[rows, columns]).tobytes())
    return message


@pytest.fixture
def updates(planners):
    process = planners.start()
    client = planners.client()
    topic = client.node.create_publisher(OccupancyGridUpdate, "map_updates", 10)
    client.wait_for(topic.get_subscription_count, "the planner to subscribe")
    return process, client, topic


def test_a_part_of_the_map_that_changed_is_taken_as_the_whole_map_with_it_would_be(updates):
    process, client, topic = updates
    topic.publish(update(FREE, slice(20, 100), slice(50, 52)))  # of no map yet; where it comes after the map, it is the same
    publish(client, process, FREE)
    topic.publish(update(DETOUR, slice(15, 100), slice(49, 53)))
    client.wait_for(lambda: process.map_id == id_of(DETOUR), "the changed map")
    topic.publish(update(walled(np.s_[30:40, 50:52]), slice(30, 40), slice(45, 60)))
    client.wait_for(lambda: process.map_id == id_of(DETOUR), "the same map")
    assert "refused" not in process.output


@pytest.mark.parametrize("window", [(slice(0, 50), slice(0, 50)), (slice(0, 0), slice(0, 50))], ids=["the same", "no cells"])
def test_an_update_that_changes_nothing_is_no_other_map(updates, window):
    process, client, topic = updates
    publish(client, process, FREE)
    topic.publish(update(FREE, *window))
    topic.publish(update(DETOUR, slice(0, 100), slice(0, 100)))
    client.wait_for(lambda: process.map_id == id_of(DETOUR), "the changed map")
    assert process.output.count("Took a map") == 2


@pytest.mark.parametrize(("changes", "words"), [
    ({"x": 60}, "reaches beyond the map of 100 x 100"), ({"y": -1}, "reaches beyond"), ({"width": 7}, "values for 7 x"),
    ({"frame": "odom"}, "in frame 'odom', not in 'map'")])
def test_an_update_that_does_not_fit_is_refused_with_the_reason(updates, changes, words):
    process, client, topic = updates
    publish(client, process, FREE)
    message = update(DETOUR, slice(0, 50), slice(0, 50))
    for name, value in changes.items():
        if name == "frame":
            message.header.frame_id = value
        else:
            setattr(message, name, value)
    topic.publish(message)
    client.wait_for_word("A map was refused: the map update")
    client.wait_for_word(words)
    assert process.map_id == id_of(FREE)
