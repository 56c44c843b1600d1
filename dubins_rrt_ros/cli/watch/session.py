"""One page that watches a planner."""

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dubins_rrt_ros.planning import checked_pose

from ..common.output import finite
from ..play import messages

if TYPE_CHECKING:
    from .listener import Listener

Send = Callable[[str | bytes], None]
#: The order in which a new page gets what is known.
ORDER = ("map", "parameters", "poses", "answer", "tree")


class WatchSession:
    """The session of one page: what it is shown, and what it asks for."""

    def __init__(self, listener: "Listener", send: Send):
        """Send what is known so far."""
        self._listener, self._send = listener, send
        self.show({"type": "hello", "watch": True, "options": messages.option_documents(), "files": []})
        with listener.lock:
            for known in (listener.latest[kind] for kind in ORDER if kind in listener.latest):
                self.show({**known, "new": True} if isinstance(known, dict) and known["type"] == "map" else known)
            listener.pages.add(self.show)

    def show(self, document: dict[str, Any] | bytes) -> None:
        """Send a document."""
        self._send(document if isinstance(document, bytes) else json.dumps(finite(document), allow_nan=False))

    async def close(self) -> None:
        """End; the planner does not notice."""
        self._listener.pages.discard(self.show)

    def take(self, text: str) -> None:
        """Take a message of the page."""
        try:
            document = json.loads(text)
            if not isinstance(document, dict):
                raise ValueError("it is no object")
            self._take(document)
        except Exception as error:  # of any kind: the page goes on
            self._refuse(str(error) or type(error).__name__)

    def _take(self, document: dict[str, Any]) -> None:
        kind = document.get("type")
        if kind == "pose":
            self._send_pose(document)
        elif kind == "cancel":
            self._listener.cancel()
        elif kind == "set":
            self._listener.set_parameter(str(document["name"]), document["value"], self._refuse)
        else:
            raise ValueError(f"there is no message of the type {kind!r}")

    def _send_pose(self, document: dict[str, Any]) -> None:
        name = document["name"]
        if name not in ("start", "goal"):
            raise ValueError(f"there is no pose {name!r}")
        pose, via = checked_pose(name, document["pose"]), [(float(x), float(y)) for x, y in document.get("via", ())]
        if via and name == "goal":
            self._listener.send_waypoints(via, pose)
        else:
            self._listener.send_pose(name, pose)

    def _refuse(self, reason: str) -> None:
        self.show({"type": "refused", "message": reason})
