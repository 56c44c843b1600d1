"""The planner as a process of its own, and its clients: what the tests of the node stand on."""

import os
import signal
import subprocess
import threading
import time
from pathlib import Path

DEADLINE = 20.0


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

    @property
    def threads(self) -> int:
        return len(list(Path(f"/proc/{self._process.pid}/task").iterdir()))

    @property
    def descriptors(self) -> int:
        """How many files and sockets it has open."""
        return len(list(Path(f"/proc/{self._process.pid}/fd").iterdir()))

    @property
    def memory(self) -> float:
        """Its resident memory [MB]."""
        pages = int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


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
        self.paths, self.statuses, self.trees, self.maps, self.diagnostics = [], [], [], [], []
        self._services = {}
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
        from geometry_msgs.msg import PoseWithCovarianceStamped

        message = _stamped(pose, frame)
        if topic == "initialpose":
            stamped, message = message, PoseWithCovarianceStamped(header=message.header)
            message.pose.pose = stamped.pose
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

    def listen_to_diagnostics(self) -> None:
        """Keep what /diagnostics has of this planner in `diagnostics`."""
        from diagnostic_msgs.msg import DiagnosticArray

        def hear(message):
            self.diagnostics += [status for status in message.status if status.name == f"{self._process.name}: planner"]

        self._subscriptions.append(self.node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10))

    def request(self, kind, name: str, **fields):
        """Call a service of the planner, such as get_plan; a future with its response."""
        client = self._services.get(name)
        if client is None:
            client = self._services[name] = self.node.create_client(kind, f"planner/{name}")
        self.wait_for(client.service_is_ready, f"the service {name}")
        return client.call_async(kind.Request(**fields))

    def call(self, kind, name: str, **fields):
        """Call a service of the planner and wait for its response."""
        future = self.request(kind, name, **fields)
        return self.wait_for(lambda: future.done() and future.result(), f"an answer of {name}")

    def request_plan(self, start, goal, tolerance: float = 0.0, frame: str = "map"):
        """Ask get_plan for a path between two (x, y, yaw) or geometry_msgs/Pose; a future with its response."""
        from nav_msgs.srv import GetPlan

        return self.request(GetPlan, "get_plan", start=_stamped(start, frame), goal=_stamped(goal, frame),
                            tolerance=tolerance)

    def set_parameters(self, **values):
        """Set parameters of the planner all at once; the rcl_interfaces/SetParametersResult."""
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        return self.call(SetParametersAtomically, "set_parameters_atomically", parameters=messages).result

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


def _stamped(pose, frame: str):
    from geometry_msgs.msg import Pose, PoseStamped

    from dubins_rrt_ros.node.conversions import pose_message

    message = PoseStamped(pose=pose if isinstance(pose, Pose) else pose_message(pose))
    message.header.frame_id = frame
    return message


def _yaml(value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, int | float) else f"'{value}'"
