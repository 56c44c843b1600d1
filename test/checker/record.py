"""Make the recorded certificates of small problems anew, for tests that need no search.

    python test/checker/record.py
"""

import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from support.certificates import RECORDED, certified, pose_in, refusal, saved

from dubins_rrt_ros.planning import GridMap, Problem, Vehicle, load_map
from dubins_rrt_ros.planning.certificate.certificate import write_certificate

CAR = Vehicle(turning_radius=0.6, robot_radius=0.2)
PLOT = ('{{"type": "FeatureCollection", "features": [{{"type": "Feature", "properties": {{"role": "bounds"}}, "geometry": '
        '{{"type": "Polygon", "coordinates": [{}]}}}}, {{"type": "Feature", "properties": {{}}, "geometry": '
        '{{"type": "Polygon", "coordinates": [{}]}}}}]}}\n')


def room(origin=(0.0, 0.0, 0.0), wall=100):
    """A room of 3 x 2.4 m with a wall across that leaves a way on one side."""
    data = np.zeros((12, 15), np.int8)
    data[:8, 7] = wall
    return GridMap(data, 0.2, origin)


def gallery():
    """Two walls, with a way on the one side and on the other."""
    data = np.zeros((14, 18), np.int8)
    data[:10, 6] = data[5:, 11] = 100
    return GridMap(data, 0.2, (1.0, -1.0, -0.3))


def islands():
    """Two ways round an obstacle."""
    data = np.zeros((14, 14), np.int8)
    data[5:9, 5:8] = 100
    return GridMap(data, 0.2, (-1.0, 2.0, 0.0))


def problems(folder):
    """Yield the names of the problems, with the problem, its map's file and the gap."""
    turned = room((3.0, -2.0, 0.4))
    unknown = room(wall=-1)

    def posed(grid, start, goal, vehicle=CAR, **request):
        return Problem(grid, vehicle, pose_in(grid, *start), pose_in(grid, *goal), **request)

    ends = (0.6, 0.6, 1.57), (2.2, 0.6, -1.57)
    yield "turned", posed(turned, *ends), saved(turned, folder / "turned"), 0.06
    yield "tolerances", posed(turned, *ends, goal_tolerance_xy=0.05, goal_tolerance_yaw=0.1), saved(turned, folder / "tol"), 0.2
    yield "any_heading", posed(room(), *ends, any_goal_heading=True), saved(room(), folder / "any"), 0.1
    yield "unknown", posed(unknown, *ends), saved(unknown, folder / "unknown"), 0.1
    yield "allowed", posed(unknown, *ends, allow_unknown=True), saved(unknown, folder / "allowed"), 0.05
    yield "gallery", posed(gallery(), (0.5, 0.5, 1.57), (2.9, 2.0, 1.57)), saved(gallery(), folder / "gallery"), 0.5
    yield "islands", posed(islands(), (0.4, 0.4, 0.3), (2.3, 2.3, 1.0)), saved(islands(), folder / "islands"), 0.05
    car = Vehicle.from_footprint([[0.25, 0.12], [-0.15, 0.12], [-0.15, -0.12], [0.25, -0.12]], turning_radius=0.5)
    yield "footprint", posed(room(), *ends, vehicle=car), saved(room(), folder / "footprint"), 0.15
    hitch = Vehicle.from_footprint([[0.4, 0.1], [0.1, 0.1], [0.1, -0.1], [0.4, -0.1]], turning_radius=0.4)
    yield "hitch", posed(room(), *ends, vehicle=hitch), saved(room(), folder / "hitch"), 0.5
    (folder / "plot.geojson").write_text(PLOT.format([[0, 0], [3, 0], [3, 2.4], [0, 2.4], [0, 0]],
                                                     [[1.4, 0], [1.6, 0.1], [1.5, 1.6], [1.4, 0]]))
    plot = load_map(folder / "plot.geojson")
    yield "polygons", Problem(plot, CAR, *((x, y, yaw) for x, y, yaw in ends)), folder / "plot.geojson", 0.1


def main():
    shutil.rmtree(RECORDED, ignore_errors=True)
    RECORDED.mkdir()
    with tempfile.TemporaryDirectory() as name:
        for title, problem, file, gap in problems(Path(name)):
            found = certified(problem, file, gap, seconds=10.0)
            document = found.document
            boxes = sum(map(len, document["boxes"]))
            print(title, f"{len(document['levels'])} levels, {boxes} boxes, {document['length']:.4f} m, "
                  f"bound {document['bound']:.4f} m", refusal(found, Path(name)) or "holds")
            write_certificate(RECORDED / f"{title}.cert", document)
            if file.suffix == ".yaml":
                text = file.read_text().replace(file.with_suffix(".pgm").name, f"{title}.pgm")
                shutil.copy(file.with_suffix(".pgm"), RECORDED / f"{title}.pgm")
                (RECORDED / f"{title}.yaml").write_text(text)
            else:
                shutil.copy(file, RECORDED / f"{title}{file.suffix}")


if __name__ == "__main__":
    main()
