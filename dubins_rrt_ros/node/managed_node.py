"""A node that a lifecycle manager, such as Nav2's, may bring up and take down."""

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node

from dubins_rrt_ros.planning.errors import PlanningError
from dubins_rrt_ros.planning.text import quoted_name

#: Transitions that end no requests.
BEGINNING = ("configure", "activate")


class ManagedNode(LifecycleNodeMixin, Node, ABC):
    """A node whose parts are made at once or, where it is managed, when it is configured.

    Subclasses make their parts in `set_up`, end them in `close`, and take requests while `is_active`. While it is managed, an
    error of ours in `set_up` leaves it unconfigured, to be tried again.

    Attributes:
        is_active: True if it is not managed, or its manager has activated it.
    """

    def __init__(self, name: str, **kwargs: Any):
        Node.__init__(self, name, **kwargs)
        self.is_active = False
        self._without_parts: set[int] = set()  # what the node has before it is set up

    @abstractmethod
    def set_up(self) -> None:
        """Make all parts."""

    @abstractmethod
    def close(self) -> None:
        """End what the parts do, as many as there are."""

    @abstractmethod
    def end_requests(self) -> Awaitable[None]:
        """End all requests, each of which is answered when this has been awaited."""

    def begin(self, managed: bool) -> None:
        """Set up and be active, or wait for a lifecycle manager."""
        if managed:
            # In the default group the transition that awaits would keep everything else waiting.
            LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
            change: Any = partial(self._change_state, self._service_change_state.callback)  # which executors await
            self._service_change_state.callback = change
            self.get_logger().info("Unconfigured: waiting for a lifecycle manager")
        else:
            self.set_up()
            self.is_active = True

    async def _change_state(self, change: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """Answer a request for a transition; rclpy's own callback, `change`, has no answer where the state does not have it.

        Requests under way are ended, and answered, before it.
        """
        wanted = request.transition
        available = {number: label for number, label, *_ in self._state_machine.available_transitions}
        label = wanted.label or available.get(wanted.id)
        if label not in available.values():
            self.get_logger().warning(f"The state '{self._state_machine.current_state[1]}' has no transition "
                                      f"{quoted_name(wanted.label) if wanted.label else wanted.id}")
            response.success = False
            return response
        if label not in BEGINNING:
            self.is_active = False
            await self.end_requests()
        return change(request, response)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Set up."""
        self._without_parts = {id(entity) for entity, _ in self._entities()}
        try:
            self.set_up()
        except PlanningError as error:
            self.get_logger().error(f"Not configured: {error}")
            self._take_down()
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take requests from now on."""
        self.is_active = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take no requests from now on."""
        self.is_active = False
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Be as before it was set up."""
        self._take_down()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take down what there is."""
        self.is_active = False
        self._take_down()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take down what there is after a defect in another transition, so that it can be configured again."""
        return self.on_shutdown(state)

    def _take_down(self) -> None:
        self.close()
        for entity, destroy in self._entities():
            if self._without_parts and id(entity) not in self._without_parts:
                destroy(entity)

    def _entities(self) -> list[tuple[Any, Callable[[Any], Any]]]:
        """Return all publishers and the like, each with the function that destroys it."""
        kinds = ((self.publishers, self.destroy_publisher), (self.subscriptions, self.destroy_subscription),
                 (self.services, self.destroy_service), (self.timers, self.destroy_timer),
                 (self.guards, self.destroy_guard_condition))
        return [(entity, destroy) for entities, destroy in kinds for entity in entities]
