"""ROS domains that no two test processes share."""

import os
import socket

#: Number of domains whose ports the system gives to nobody else: 1 to 101.
COUNT = 101
_claims: list[socket.socket] = []


def claim_domain() -> int:
    """Return a ROS domain that no other test process on this machine uses until this one ends.

    A claim is a socket in Linux' abstract namespace: it needs no file, ends with the process, and is not inherited.
    Where all domains are taken, one is shared, and the namespaces of the nodes keep them apart.
    """
    first = os.getpid()
    for number in range(first, first + COUNT):
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f"\0dubins_rrt_ros test domain {1 + number % COUNT}")
        except OSError:
            claim.close()
        else:
            _claims.append(claim)
            return 1 + number % COUNT
    return 1 + first % COUNT
