"""A path as bytes in CDR, the encoding of DDS, little endian: ten thousand poses in 3 ms, where messages take 100."""

import struct

import numpy as np
from builtin_interfaces.msg import Time

from .conversions import planar_rows


def serialized_path(poses: np.ndarray, frame: str, stamp: Time) -> bytes:
    """Return `conversions.path_message` as it goes over the wire.

    Args:
        poses: (n, 3), as x [m], y [m] and yaw [rad].
        frame, stamp: of the path and of every pose.
    """
    name = frame.encode() + b"\0"
    header = struct.pack("<iII", stamp.sec, stamp.nanosec, len(name)) + name
    begin = header + bytes(-len(header) % 4) + struct.pack("<I", len(poses))
    numbers = np.zeros((len(poses), 7))
    numbers[:, [0, 1, 5, 6]] = planar_rows(poses)
    # Doubles are aligned to 8 bytes, which the first pose need not begin at; all others do.
    aligned = header + bytes(-len(header) % 8)
    others = np.empty((max(0, len(poses) - 1), len(aligned) + 8 * 7), np.uint8)
    others[:, :len(aligned)] = np.frombuffer(aligned, np.uint8)
    others[:, len(aligned):] = numbers[1:].view(np.uint8)
    first = header + bytes(-len(begin + header) % 8) if len(poses) else b""
    return b"\0\1\0\0" + begin + first + numbers[:1].tobytes() + others.tobytes()
