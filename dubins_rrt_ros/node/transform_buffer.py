"""A buffer of transforms between frames, for where tf2_ros is not installed; it answers as that does. It knows nothing of ROS."""

import threading
from bisect import bisect_left
from dataclasses import dataclass, field

from dubins_rrt_ros.planning.text import quoted_name

from .rigid import IDENTITY, Rigid

#: Time for which transforms are kept, before the newest of each frame [ns].
HISTORY = 10_000_000_000


class TransformUnknown(Exception):
    """A transform that is not known; the message says why.

    Attributes:
        is_final: True if it can no longer come.
        remedy: what would make it known.
    """

    def __init__(self, message: str, is_final: bool = False, remedy: str = "publish that transform"):
        super().__init__(message)
        self.is_final, self.remedy = is_final, remedy


@dataclass
class _Frame:
    """A frame in its parent over time.

    Attributes:
        parent: the name of its parent.
        is_static: True if it never moves; then it has one pose.
        stamps: times of its poses, ascending [ns].
        poses: its poses at these times.
    """

    parent: str
    is_static: bool
    stamps: list[int] = field(default_factory=list)
    poses: list[Rigid] = field(default_factory=list)

    def add(self, stamp: int, pose: Rigid) -> None:
        at = bisect_left(self.stamps, stamp)
        if at < len(self.stamps) and self.stamps[at] == stamp:
            self.poses[at] = pose
        else:
            self.stamps.insert(at, stamp)
            self.poses.insert(at, pose)
        outdated = bisect_left(self.stamps, self.stamps[-1] - HISTORY)
        del self.stamps[:outdated], self.poses[:outdated]

    def at(self, name: str, stamp: int) -> Rigid:
        """Return the pose at a time, interpolated between those before and after it."""
        if self.is_static:
            return self.poses[0]
        if not self.stamps[0] <= stamp <= self.stamps[-1]:
            is_past = stamp < self.stamps[0]
            end, which = (self.stamps[0], "before the oldest") if is_past else (self.stamps[-1], "after the newest")
            raise TransformUnknown(f"the time asked for is {abs(stamp - end) / 1e9:.3f} s {which} transform from "
                                   f"{quoted_name(self.parent)} to {quoted_name(name)}", is_final=is_past)
        after = bisect_left(self.stamps, stamp)
        if self.stamps[after] == stamp:
            return self.poses[after]
        begin, end = self.stamps[after - 1:after + 1]
        return self.poses[after - 1].towards(self.poses[after], (stamp - begin) / (end - begin))


class TransformBuffer:
    """Keeps the transforms of the last seconds, and joins them to chains. Several threads may use it."""

    def __init__(self) -> None:
        self._frames: dict[str, _Frame] = {}
        self._lock = threading.Lock()

    def add(self, parent: str, child: str, stamp: int, pose: Rigid, is_static: bool) -> None:
        """Take the pose of a frame in its parent at a time [ns]; a new parent makes all before it void."""
        with self._lock:
            known = self._frames.get(child)
            if known is None or known.parent != parent or known.is_static or is_static:
                known = self._frames[child] = _Frame(parent, is_static)
            known.add(stamp, pose)

    def lookup(self, target: str, source: str, stamp: int | None = None) -> tuple[Rigid, int | None]:
        """Return the pose of frame `source` in frame `target`.

        Args:
            target, source: names of frames.
            stamp: a time [ns]; None for the latest at which all transforms in between are known.

        Returns:
            The pose, and its time: None where nothing in between moves.

        Raises:
            TransformUnknown: a frame or the time is not known, or nothing joins the frames.
        """
        with self._lock:
            up, down = self._chains(target, source)
            if stamp is None:
                newest = [self._frames[name].stamps[-1] for name in (*up, *down) if not self._frames[name].is_static]
                stamp = min(newest, default=None)
            return self._joined(down, stamp).inverse.after(self._joined(up, stamp)), stamp

    def forget_moving(self) -> None:
        """Forget all frames that move: their times are of no use once the clock was set back."""
        with self._lock:
            self._frames = {name: frame for name, frame in self._frames.items() if frame.is_static}

    def _joined(self, chain: list[str], stamp: int | None) -> Rigid:
        """Return the pose of the first frame of a chain in the parent of its last."""
        pose = IDENTITY
        for name in chain:
            pose = self._frames[name].at(name, 0 if stamp is None else stamp).after(pose)
        return pose

    def _chains(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """Return the frames from source, and from target, up to where these meet, that frame excluded."""
        up, down = self._ancestry(source), self._ancestry(target)
        if up[-1] != down[-1]:
            known = {*self._frames, *(frame.parent for frame in self._frames.values())}
            missing = [name for name in (source, target) if name not in known]
            raise TransformUnknown(f"there is no frame {quoted_name(missing[0])} yet" if missing else
                                   f"no transforms join {quoted_name(source)} and {quoted_name(target)}")
        while up and down and up[-1] == down[-1]:
            up.pop()
            down.pop()
        return up, down

    def _ancestry(self, name: str) -> list[str]:
        """Return a frame and all above it."""
        names = [name]
        while names[-1] in self._frames:
            parent = self._frames[names[-1]].parent
            if parent in names:
                raise TransformUnknown(f"{quoted_name(name)} is its own ancestor, by {quoted_name(parent)}",
                                       remedy="end one of the publishers that give their frames parents in a circle")
            names.append(parent)
        return names
