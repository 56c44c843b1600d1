"""The request that the demonstration makes and every example of the help shows: through the installed maze."""

import math

MAP = "maze"
#: The poses at which the vehicle starts and is to arrive: (x [m], y [m], yaw [rad]).
START = (1.5, 2.0, math.pi / 2)
GOAL = (13.5, 10.5, math.pi / 2)


def _words(pose: tuple[float, float, float]) -> str:
    return " ".join(f"{number:.3g}" for number in pose)


#: The request as the command line takes it.
ENDS = f"--start {_words(START)} --goal {_words(GOAL)}"
EXAMPLE = f"dubins_rrt plan {MAP} {ENDS} --plot {MAP}.png"
