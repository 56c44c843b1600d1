"""A conversation with one planner: requests one after the other, each with its answer."""

import math
from contextlib import contextmanager

from geometry_msgs.msg import Point, Pose
from std_srvs.srv import Trigger

from support.harness import Client, NodeProcess, values_of


class Conversation:
    """Requests to one planner, one after the other, by a client that sends all of them.

    Attributes:
        asked: the plan_id of the newest request.
    """

    def __init__(self, process: NodeProcess, client: Client):
        self.process, self.client = process, client
        self.asked = 0
        self._goal = None  # that was sent last

    def start(self, pose, topic: str = "start_pose") -> None:
        """Send a start that the next goal finds, though topics keep no common order: without any, a goal waits for it."""
        self.refused_start(Pose(position=Point(x=math.nan)))
        self.client.send(topic, pose)

    def refused_start(self, pose, frame: str = "map", topic: str = "start_pose") -> dict[str, str]:
        """The status after a start that cannot be used; the planner knows none then."""
        self.client.statuses.clear()
        self.client.send(topic, pose, frame)
        names = ("INVALID_POSE", "TF_ERROR")  # and not what was said of maps before
        name = self.client.wait_for(lambda: next((values["error_name"] for values in map(values_of, self.client.statuses)
                                                  if values["plan_id"] == "0" and values["error_name"] in names), None),
                                    "the refusal of a start")
        return self.client.status_of(0, error_name=name)

    def goal(self, pose, frame: str = "map", **wanted: str) -> dict[str, str]:
        """The status of a goal, the first that has the wanted values. The same goal again is planned anew."""
        if pose == self._goal:
            self.client.call(Trigger, "cancel")  # while it is planned, the same would not disturb it
        self._goal = pose
        self.asked += 1
        self.client.statuses.clear()
        self.client.send("goal_pose", pose, frame)
        return self.client.status_of(self.asked, **wanted)

    def plan(self, start, goal, **more) -> tuple[dict[str, str], list]:
        """The status of a request to get_plan, and the poses of its response."""
        self.asked += 1
        self.client.statuses.clear()
        future = self.client.request_plan(start, goal, **more)
        response = self.client.wait_for(lambda: future.done() and future.result(), "a plan")
        return self.client.status_of(self.asked), response.plan.poses

    @contextmanager
    def going_on(self, start, goal, map_id: str):
        """Whatever is done within, a good goal is answered after it, on this map, and nothing was a defect."""
        said = len(self.process.output)
        yield
        self.start(start)
        told = self.goal(goal)
        assert (told["error_name"], told["map_id"]) == ("NONE", map_id)
        assert self.process.running
        log = self.process.output[said:]
        assert "Traceback" not in log
        assert "Warning" not in log, "numpy warns"
