"""Pipe between supervisor and node: the node sends 'ready', the supervisor answers 'go'. A node without a
supervisor starts at once.
"""

from __future__ import annotations

import contextlib
import os
import socket

VARIABLE = "DEEPTRUCK_LIFELINE"


class Lifeline:
    """A node's end of the pipe."""

    def __init__(self) -> None:
        number = os.environ.get(VARIABLE)
        self._socket = socket.socket(fileno=int(number)) if number else None
        self._said = self._released = False

    def ready(self) -> None:
        """Report readiness to the supervisor, once."""
        if self._socket is not None and not self._said:
            with contextlib.suppress(OSError):  # a supervisor that is gone ends this process in another way
                self._socket.send(b"ready")
        self._said = True

    def may_go(self) -> bool:
        """Whether all other nodes are ready too; never blocks."""
        self.is_cut()
        return self._socket is None or self._released

    def is_cut(self) -> bool:
        """Whether a supervisor was connected and has ended; never blocks."""
        if self._socket is None:
            return False
        try:
            received = self._socket.recv(16, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            return True
        self._released = self._released or received == b"go"
        return not received


class LifelineHolder:
    """The supervisor's end. `child` is the file descriptor that the process receives in VARIABLE."""

    def __init__(self) -> None:
        self._socket, self._child = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.is_ready = False

    @property
    def child(self) -> int:
        return self._child.fileno()

    def handed_over(self) -> None:
        """Close the supervisor's copy of the child's end."""
        self._child.close()

    def poll(self) -> bool:
        """Whether the node has reported that it is ready."""
        with contextlib.suppress(OSError):
            self.is_ready = self.is_ready or self._socket.recv(16, socket.MSG_DONTWAIT) == b"ready"
        return self.is_ready

    def go(self) -> None:
        with contextlib.suppress(OSError):  # a node that has just died is found by its exit code
            self._socket.send(b"go")

    def close(self) -> None:
        self._socket.close()
