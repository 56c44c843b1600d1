"""The messages that PyPI does not have: they go over the wire."""

from importlib import import_module

import pytest

pytestmark = pytest.mark.messages
pytest.importorskip("nav2_msgs", reason="nav2_msgs is not here; .ci/messages builds it")

MESSAGES = [
    ("map_msgs.msg", "OccupancyGridUpdate", {"x": 1, "y": 2, "width": 2, "height": 1, "data": [100, -1]}),
    ("tf2_msgs.msg", "TFMessage", {}),
    ("nav2_msgs.action", "ComputePathToPose.Goal", {"planner_id": "GridBased", "use_start": True}),
    ("nav2_msgs.action", "ComputePathToPose.Result", {"error_code": 208, "error_msg": "no path"}),
    ("nav2_msgs.action", "ComputePathThroughPoses.Result", {"error_code": 309}),
    ("nav2_msgs.action", "FollowPath.Feedback", {"distance_to_goal": 1.5, "speed": 0.25}),
    ("nav2_msgs.srv", "IsPathValid.Response", {"is_valid": False, "invalid_pose_indices": [3, 4]}),
    ("nav2_msgs.srv", "ClearEntireCostmap.Request", {}),
]


@pytest.mark.parametrize(("module", "name", "fields"), MESSAGES, ids=[row[1] for row in MESSAGES])
def test_a_message_goes_over_the_wire(over_the_wire, module, name, fields):
    kind = import_module(module)
    for part in name.split("."):
        kind = getattr(kind, part)
    message = kind(**fields)
    assert over_the_wire(message) == message
