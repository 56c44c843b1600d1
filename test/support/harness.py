"""The planner as a process of its own, and its clients: what the tests of the node stand on."""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

from support.forked import ForkedPlanner

#: Maximum time until something happens that a test waits for, on a machine that is busy [s].
DEADLINE = 60.0
#: Time after which a request is made again [s].
ASK_AGAIN = 10.0


class NodeProcess:
    """The planner as a process of its own: forked, or by a command."""

    def __init__(self, namespace: str, arguments: list[str], command: list[str] | None = None):
        self.name = f"{namespace}/planner"
        arguments = ["--ros-args", "-r", f"__ns:={namespace}", *arguments]
        self._process = ForkedPlanner(arguments) if command is None else subprocess.Popen(
            [*command, *arguments], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONUNBUFFERED": "1"})
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

    @property
    def map_id(self) -> str:
        """The id of the map that is in use and prepared, by its log."""
        return self.output.rpartition("The map is ready, id ")[2][:12]

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

    def end(self, by: signal.Signals, again_after: float | None = None) -> int:
        """Its exit status after a signal, or two of them."""
        self._process.send_signal(by)
        if again_after is not None:
            time.sleep(again_after)
            self._process.send_signal(by)
        return self.wait()

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
        self.marks: set[int] = set()
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

    def spin_once(self) -> None:
        """Hear what has come, for a millisecond at most where nothing has."""
        self._executor.spin_once(timeout_sec=0.001)

    def spin_until_done(self, future, timeout: float) -> None:
        """Until a future is done, or the time is over [s]."""
        self._executor.spin_until_future_complete(future, timeout)

    def wait_for_word(self, word: str) -> None:
        """Until the planner has logged this; its log comes through a pipe, and may be later than its messages."""
        self.wait_for(lambda: word in self._process.output, f"{word!r} in the log")

    def send(self, topic: str, pose, frame: str = "map") -> None:
        """Publish (x, y, yaw) or a geometry_msgs/Pose on a pose topic."""
        from geometry_msgs.msg import PoseWithCovarianceStamped

        message = stamped(pose, frame)
        if topic == "initialpose":
            plain, message = message, PoseWithCovarianceStamped(header=message.header)
            message.pose.pose = plain.pose
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
        return self._service(kind, name).call_async(kind.Request(**fields))

    def call(self, kind, name: str, **fields):
        """Call a service of the planner and wait for its response."""
        return self.ask(self._service(kind, name), kind.Request(**fields))

    def _service(self, kind, name: str):
        client = self._services.get(name)
        if client is None:
            client = self._services[name] = self.node.create_client(kind, f"planner/{name}")
        self.wait_for(client.service_is_ready, f"the service {name}")
        return client

    def ask(self, service, request):
        """Wait for the response to a request that bears to be made again: a server drops that to a client not found yet."""
        last, futures = -math.inf, []

        def response():
            nonlocal last
            if time.monotonic() > last + ASK_AGAIN:
                last = time.monotonic()
                futures.append(service.call_async(request))
            return next((future.result() for future in futures if future.done() and future.result()), None)

        return self.wait_for(response, "an answer of a service")

    def response(self, future):
        """Wait for what a service answers."""
        return self.wait_for(lambda: future.done() and future.result(), "an answer of a service")

    def request_plan(self, start, goal, tolerance: float = 0.0, frame: str = "map"):
        """Ask get_plan for a path between two (x, y, yaw), geometry_msgs/Pose or PoseStamped; a future with its response."""
        from nav_msgs.srv import GetPlan

        return self.request(GetPlan, "get_plan", start=stamped(start, frame), goal=stamped(goal, frame),
                            tolerance=tolerance)

    def plan(self, start, goal, **more):
        """Ask get_plan and wait: the path, and the request's status as by `status_of`."""
        path = self.response(self.request_plan(start, goal, **more)).plan
        return path, self._status(f"a status of {path.header.stamp}", stamp=_seconds(path.header.stamp))

    def begin_plan(self, start, goal):
        """Ask get_plan; a future with its response, and its plan_id, of a request that has come in when this returns."""
        return self._begun(lambda: self.request_plan(start, goal))

    def begin_goal(self, goal) -> int:
        """Send a goal that differs from the standing one; its plan_id, of a goal that has come in when this returns."""
        return self._begun(lambda: self.send("goal_pose", goal))[1]

    def _begun(self, ask):
        """Ask for something: what that gives, and the plan_id, which lies between two marks."""
        first = last = self.mark()
        asked, marks = ask(), 0
        while last == first + marks:
            last, marks = self.mark(), marks + 1
        return asked, last - 1

    def mark(self) -> int:
        """A plan_id of its own, by a topic: requests that came in before have lower ones. All statuses until then are heard."""
        from geometry_msgs.msg import PoseArray

        if "goal_poses" not in self._publishers:
            self._publishers["goal_poses"] = self.node.create_publisher(PoseArray, "goal_poses", 10)
            self.wait_for(self._publishers["goal_poses"].get_subscription_count, "the planner to subscribe to goal_poses")
        heard = len(self.statuses)
        self._publishers["goal_poses"].publish(PoseArray())  # none, which is refused and disturbs nothing

        def refusals():
            return [status for status in self.statuses[heard:] if "no poses in goal_poses" in status.message]

        self.marks.add(plan_id := int(values_of(self.wait_for(refusals, "the refusal of no poses")[0])["plan_id"]))
        return plan_id

    def cancel(self, *futures):
        """Have everything cancelled, these requests to get_plan too where they come in later, and hear what is said of it."""
        from std_srvs.srv import Trigger

        self.wait_for(lambda: self.call(Trigger, "cancel").success and all(future.done() for future in futures), "an end of all")
        self.mark()

    def set_parameters(self, **values):
        """Set parameters of the planner all at once; the rcl_interfaces/SetParametersResult."""
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter

        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        return self.call(SetParametersAtomically, "set_parameters_atomically", parameters=messages).result

    def status_of(self, plan_id: int, **wanted: str) -> dict[str, str]:
        """The values, `level` and `message` of the next status of a request that has the wanted values."""
        return self._status(f"a status of request {plan_id} with {wanted}", plan_id=str(plan_id), **wanted)

    def _status(self, what: str, **wanted: str) -> dict[str, str]:
        def find():
            for status in self.statuses:
                values = values_of(status)
                if wanted.items() <= values.items():
                    return values | {"level": status.level, "message": status.message, "name": status.name}
            return None
        return self.wait_for(find, what)

    @property
    def next_id(self) -> int:
        """The plan_id of the next request, where the last one has been answered."""
        return 1 + max((int(values_of(status)["plan_id"]) for status in self.statuses), default=0)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


class Planners:
    """Starts planners and clients; ends all of them.

    A planner that is started without a command is forked; with `installed`, and where a workspace brings the command, it is the
    installed command, in an interpreter of its own.
    """

    _count = 0

    def __init__(self, installed: bool = False):
        from dubins_rrt_ros.cli.demo.process import planner_command

        command = planner_command()
        self._command = command if installed or Path(command[0]).parent != Path(sys.executable).parent else None
        self._processes: list[NodeProcess] = []
        self._clients: list[Client] = []

    def start(self, *arguments: str, command: list[str] | None = None, **parameters) -> NodeProcess:
        """The planner, or another command that is one, with these parameters, in a namespace of its own."""
        Planners._count += 1
        # With the process' number, as another run of the tests may be in the same domain.
        self._namespace = f"/test{os.getpid()}_{Planners._count}"
        return self.restart(*arguments, command=command, **parameters)

    def restart(self, *arguments: str, command: list[str] | None = None, **parameters) -> NodeProcess:
        """Another planner in the namespace of the last."""
        rules = [part for name, value in parameters.items() for part in ("-p", f"{name}:={_yaml(value)}")]
        self._processes.append(NodeProcess(self._namespace, [*rules, *arguments], command or self._command))
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


def assert_says(told: dict[str, str], code: str, name: str, *words: str) -> None:
    """A status has the code and its name, and all the words in its sentence."""
    assert (told["error_code"], told["error_name"]) == (code, name), told["message"]
    assert [word for word in words if word not in told["message"]] == [], told["message"]


def values_of(status) -> dict[str, str]:
    """The values of a status by key."""
    return {item.key: item.value for item in status.values}


def poses_of(path) -> np.ndarray:
    """(n, 3) x [m], y [m], yaw [rad] of a path message."""
    return np.array([(p.pose.position.x, p.pose.position.y, 2 * math.atan2(p.pose.orientation.z, p.pose.orientation.w))
                     for p in path.poses]).reshape(-1, 3)


def occupancy(cells: np.ndarray, frame: str = "map"):
    """A map message with these values, in cells of 0.1 m from (0, 0) on."""
    from builtin_interfaces.msg import Time

    from dubins_rrt_ros.node.conversions import grid_message
    from dubins_rrt_ros.planning import GridMap

    return grid_message(GridMap(cells, 0.1), frame, Time())


def stamped(pose, frame: str = "map"):
    """A PoseStamped of an (x, y, yaw) or a geometry_msgs/Pose; one that is stamped already stays."""
    from geometry_msgs.msg import Pose, PoseStamped

    from dubins_rrt_ros.node.conversions import pose_message

    if isinstance(pose, PoseStamped):
        return pose
    message = PoseStamped(pose=pose if isinstance(pose, Pose) else pose_message(pose))
    message.header.frame_id = frame
    return message


def _seconds(stamp) -> str:
    """A stamp as a status has it."""
    return f"{stamp.sec}.{stamp.nanosec:09}"


def _yaml(value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, int | float) else f"'{value}'"
