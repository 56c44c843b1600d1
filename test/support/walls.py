"""Maps with and without walls, which a planner hears by topic, and the paths that it shows on them."""

import numpy as np

from dubins_rrt_ros.planning import GridMap
from support.harness import occupancy, poses_of, values_of
from support.yard import GOAL, QUICK, START


def walled(*rows_and_columns):
    """10 m x 10 m with walls, each the rows and columns that it takes."""
    cells = np.zeros((100, 100), dtype=np.int8)
    for part in rows_and_columns:
        cells[part] = 100
    return cells


FREE = walled()
#: A wall across the way from START to GOAL that leaves 2 m at the lower edge.
DETOUR = walled(np.s_[20:, 50:52])
CLOSED = walled(np.s_[:, 50:52])
#: A box far from the way.
HARMLESS = walled(np.s_[95:, :5])


def id_of(cells):
    return GridMap(cells, 0.1).id


def publish(client, process, cells):
    """Publish a map; it is in use and prepared when this returns."""
    client.publish_map(occupancy(cells))
    client.wait_for(lambda: process.map_id == id_of(cells), f"the map {id_of(cells)} to be taken")


def show_path(client, process):
    """The id of a request whose path, straight through the free map, is on display."""
    client.cancel()
    client.set_parameters(**QUICK)
    publish(client, process, FREE)
    client.send("start_pose", START)
    return end_of_goal(client)


def end_of_goal(client):
    plan_id = client.next_id
    client.send("goal_pose", GOAL)
    told = client.status_of(plan_id, samples=str(QUICK["samples"]))
    assert (told["error_name"], told["map_id"]) == ("NONE", id_of(FREE))
    client.wait_for(lambda: client.paths and len(client.paths[-1].poses) > 1, "its path")
    return plan_id


def distance_to_wall(path, cells):
    """The least distance from a path's points to the occupied cells [m]."""
    rows, columns = np.nonzero(cells)
    low = np.stack([columns, rows], axis=1) * 0.1
    off = np.maximum(np.maximum(low - (points := path[:, None, :2]), points - low - 0.1), 0.0)
    return np.hypot(off[..., 0], off[..., 1]).min()


def wait_for_path_around(client, cells):
    """Until the path on display keeps away from the occupied cells, as the ones before did not."""
    client.wait_for(lambda: client.paths[-1].poses and distance_to_wall(poses_of(client.paths[-1]), cells) >= 0.2,
                    "a path around")


def statuses_of(client, plan_id):
    return [values_of(status) for status in client.statuses if values_of(status)["plan_id"] == str(plan_id)]
