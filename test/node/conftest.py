"""Fixtures: messages that went through the wire format, plans, and the node as a process of its own."""

import os
import signal
import subprocess
import threading
import time

import pytest

# Before rclpy is imported: a field of the wrong type is an error, and nobody else hears us.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
# Domains up to 101 have ports that the system gives to nobody else.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 101)

DEADLINE = 20.0

#: Fast DDS announces a participant five times at 0.1 s; who is not there yet waits for seconds.
EAGER_DISCOVERY = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="eager" is_default_profile="true">
    <rtps><builtin><discovery_config><initialAnnouncements>
      <count>100</count><period><sec>0</sec><nanosec>50000000</nanosec></period>
    </initialAnnouncements></discovery_config></builtin></rtps>
  </participant>
</profiles>
"""


@pytest.fixture(scope="session", autouse=True)
def _ros_environment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ros")
    profile = folder / "eager_discovery.xml"
    profile.write_text(EAGER_DISCOVERY)
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(profile)
    os.environ["ROS_LOG_DIR"] = str(folder / "log")


@pytest.fixture(scope="session")
def over_the_wire():
    """A function that gives back a message as a receiver has it."""
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")

    def transfer(message):
        return serialization.deserialize_message(serialization.serialize_message(message), type(message))

    return transfer


@pytest.fixture(scope="session")
def plans():
    """Real plans by name: `solved`, `blocked` (the goal is occupied)."""
    import numpy as np

    from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, plan

    cells = np.zeros((100, 100), dtype=np.int8)
    cells[40:60, 40:60] = 100
    grid = GridMap(cells, 0.1)
    settings = Settings(samples=300, planning_time=20.0, seed=1)
    start = (1.5, 5.0, 0.0)
    return {name: plan(Problem(grid, Vehicle(), start, goal), settings)
            for name, goal in {"solved": (8.5, 5.0, 0.5), "blocked": (5.0, 5.0, 0.0)}.items()}


@pytest.fixture
def map_yaml(tmp_path):
    """A map_server pair: 10 m x 10 m, free but for a box of 2 m in its middle."""
    rows = [[0 if 40 <= row < 60 and 40 <= column < 60 else 254 for column in range(100)] for row in range(100)]
    lines = "\n".join(" ".join(map(str, row)) for row in rows)
    (tmp_path / "box.pgm").write_text(f"P2\n100 100\n255\n{lines}\n")
    path = tmp_path / "box.yaml"
    path.write_text("image: box.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
                    "occupied_thresh: 0.65\nfree_thresh: 0.25\n")
    return path


class NodeProcess:
    """The installed planner as a process of its own."""

    def __init__(self, namespace: str, arguments: list[str]):
        from dubins_rrt_ros.share import planner_command

        self.name = f"{namespace}/planner"
        self._process = subprocess.Popen(
            [*planner_command(), "--ros-args", "-r", f"__ns:={namespace}", *arguments], text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**os.environ, "PYTHONUNBUFFERED": "1"})
        self._lines: list[str] = []
        self._heard = threading.Condition()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        for line in self._process.stdout:
            with self._heard:
                self._lines.append(line)
                self._heard.notify_all()

    @property
    def output(self) -> str:
        with self._heard:
            return "".join(self._lines)

    def wait_until_ready(self) -> None:
        """Until it has said its first word, which it does once it is on the network."""
        with self._heard:
            assert self._heard.wait_for(lambda: self._lines, DEADLINE), "the node says nothing"

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def wait(self) -> int:
        """Its exit status."""
        status = self._process.wait(DEADLINE)
        self._reader.join(DEADLINE)
        return status

    def end(self, by: signal.Signals) -> tuple[int, float]:
        """Its exit status after a signal, and how long it took [s]."""
        begin = time.monotonic()
        self._process.send_signal(by)
        return self.wait(), time.monotonic() - begin

    def kill(self) -> None:
        if self.running:
            self._process.kill()
        self.wait()
        self._process.stdout.close()


class Client:
    """Topics of the planner in this process; what it hears is kept in lists."""

    def __init__(self, namespace: str, node_process: NodeProcess, listens_to_tree: bool):
        import rclpy
        from diagnostic_msgs.msg import DiagnosticStatus
        from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
        from nav_msgs.msg import OccupancyGrid
        from nav_msgs.msg import Path as PathMessage
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from visualization_msgs.msg import MarkerArray

        self._process = node_process
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node("client", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.paths, self.statuses, self.trees, self.maps = [], [], [], []
        outputs = [("plan", PathMessage, self.paths), ("planner/status", DiagnosticStatus, self.statuses)]
        if listens_to_tree:
            outputs.append(("planner/tree", MarkerArray, self.trees))
        self._subscriptions = [self.node.create_subscription(kind, topic, heard.append, latched)
                               for topic, kind, heard in outputs]
        inputs = {"start_pose": PoseStamped, "initialpose": PoseWithCovarianceStamped, "goal_pose": PoseStamped}
        self._publishers = {topic: self.node.create_publisher(kind, topic, 10) for topic, kind in inputs.items()}
        self._map_type, self._latched = OccupancyGrid, latched
        self.wait_for(lambda: all(s.get_publisher_count() for s in self._subscriptions)
                      and all(p.get_subscription_count() for p in self._publishers.values()), "the planner's topics")

    def follow(self, node_process: NodeProcess) -> None:
        """From now on this is the process that must not end while something is waited for."""
        self._process = node_process

    def wait_for(self, condition, what: str):
        """Spin until `condition()` is true and give back its value."""
        deadline = time.monotonic() + DEADLINE
        while not (value := condition()):
            assert self._process.running, f"the node ended while waiting for {what}:\n{self._process.output}"
            assert time.monotonic() < deadline, f"no {what} in {DEADLINE} s; the node says:\n{self._process.output}"
            self._executor.spin_once(timeout_sec=0.05)
        return value

    def send(self, topic: str, pose, frame: str = "map") -> None:
        """Publish (x, y, yaw) or a geometry_msgs/Pose on a pose topic."""
        from geometry_msgs.msg import Pose, PoseStamped, PoseWithCovarianceStamped

        from dubins_rrt_ros.node.conversions import pose_message

        pose = pose if isinstance(pose, Pose) else pose_message(pose)
        message = PoseWithCovarianceStamped() if topic == "initialpose" else PoseStamped()
        message.header.frame_id = frame
        if topic == "initialpose":
            message.pose.pose = pose
        else:
            message.pose = pose
        self._publishers[topic].publish(message)

    def listen_to_map(self) -> None:
        heard = self.maps.append
        self._subscriptions.append(self.node.create_subscription(self._map_type, "map", heard, self._latched))

    def publish_map(self, message, qos=None) -> None:
        publisher = self._publishers.get("map")
        if publisher is None:
            publisher = self.node.create_publisher(self._map_type, "map", qos or self._latched)
            self._publishers["map"] = publisher
        self.wait_for(publisher.get_subscription_count, "the planner to subscribe to map")
        publisher.publish(message)

    def status_of(self, plan_id: int, **wanted: str) -> dict[str, str]:
        """The values, `level` and `message` of the next status of a request that has the wanted values."""
        def find():
            for status in self.statuses:
                values = {item.key: item.value for item in status.values}
                if values["plan_id"] == str(plan_id) and wanted.items() <= values.items():
                    return values | {"level": status.level, "message": status.message, "name": status.name}
            return None
        return self.wait_for(find, f"a status of request {plan_id} with {wanted}")

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


class Planners:
    """Starts planners and clients; ends all of them."""

    _count = 0

    def __init__(self):
        self._processes: list[NodeProcess] = []
        self._clients: list[Client] = []

    def start(self, *arguments: str, **parameters) -> NodeProcess:
        """The planner with these parameters, in a namespace of its own."""
        Planners._count += 1
        self._namespace = f"/test{Planners._count}"
        return self.restart(*arguments, **parameters)

    def restart(self, *arguments: str, **parameters) -> NodeProcess:
        """Another planner in the namespace of the last."""
        rules = [part for name, value in parameters.items() for part in ("-p", f"{name}:={_yaml(value)}")]
        self._processes.append(NodeProcess(self._namespace, [*rules, *arguments]))
        return self._processes[-1]

    def client(self, listens_to_tree: bool = False) -> Client:
        """A client of the planner that was started last."""
        # Participants that start at the same time find each other only after seconds.
        self._processes[-1].wait_until_ready()
        self._clients.append(Client(self._namespace, self._processes[-1], listens_to_tree))
        return self._clients[-1]

    def close(self) -> None:
        for client in self._clients:
            client.close()
        try:
            for process in self._processes:
                if process.running:
                    process.end(signal.SIGTERM)
        finally:
            for process in self._processes:
                process.kill()


def _yaml(value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, int | float) else f"'{value}'"


@pytest.fixture
def planners():
    """Planner processes and their clients."""
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    planners = Planners()
    yield planners
    planners.close()
