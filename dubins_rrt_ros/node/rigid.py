"""Rigid transforms of space, as quaternions and translations."""

import math
from typing import NamedTuple

#: Cosine of half the angle between two rotations above which they are interpolated linearly.
NEARLY_EQUAL = 0.9995


class Rotation(NamedTuple):
    """A rotation as a unit quaternion."""

    w: float
    x: float
    y: float
    z: float

    @property
    def inverse(self) -> "Rotation":
        """The rotation back."""
        return Rotation(self.w, -self.x, -self.y, -self.z)

    def after(self, other: "Rotation") -> "Rotation":
        """Return the Hamilton product: the rotation `other`, then this one."""
        a, b = self, other
        return Rotation(a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w)

    def applied(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return a point, rotated about the origin."""
        _, x, y, z = self.after(Rotation(0.0, x, y, z)).after(self.inverse)
        return x, y, z

    def towards(self, other: "Rotation", share: float) -> "Rotation":
        """Return the rotation at a share of the shortest way to another one (spherical linear interpolation)."""
        cosine = sum(a * b for a, b in zip(self, other, strict=True))
        sign, cosine = math.copysign(1.0, cosine), abs(cosine)
        if cosine > NEARLY_EQUAL:
            ours, theirs = 1 - share, share
        else:
            angle = math.acos(cosine)
            ours, theirs = math.sin((1 - share) * angle) / math.sin(angle), math.sin(share * angle) / math.sin(angle)
        mixed = [ours * a + sign * theirs * b for a, b in zip(self, other, strict=True)]
        norm = math.hypot(*mixed)
        return Rotation(*(component / norm for component in mixed))


class Rigid(NamedTuple):
    """A rotation about the origin, then a translation [m]: the pose of a frame in its parent."""

    x: float
    y: float
    z: float
    rotation: Rotation

    @property
    def inverse(self) -> "Rigid":
        """The pose of the parent in the frame."""
        back = self.rotation.inverse
        return Rigid(*back.applied(-self.x, -self.y, -self.z), back)

    def after(self, other: "Rigid") -> "Rigid":
        """Return the transform `other`, then this one."""
        x, y, z = self.rotation.applied(other.x, other.y, other.z)
        return Rigid(x + self.x, y + self.y, z + self.z, self.rotation.after(other.rotation))

    def towards(self, other: "Rigid", share: float) -> "Rigid":
        """Return the transform at a share of the way to another one."""
        x, y, z = (a + share * (b - a) for a, b in zip(self[:3], other[:3], strict=True))
        return Rigid(x, y, z, self.rotation.towards(other.rotation, share))


IDENTITY = Rigid(0.0, 0.0, 0.0, Rotation(1.0, 0.0, 0.0, 0.0))
