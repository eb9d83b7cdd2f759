"""Where the page is: a socket that listens on 127.0.0.1, and the word that opens it.

The start script makes both and hands them to the page's process. The word goes by the environment, which only
the same user can read; a parameter file or a log could be read by everyone. The socket outlives a page that
died: its address stays the same.
"""

from __future__ import annotations

import os
import secrets
import socket
from dataclasses import dataclass

from deeptruck_model.errors import InputError

LOCAL = "127.0.0.1"
SOCKET, TOKEN = "DEEPTRUCK_PAGE_SOCKET", "DEEPTRUCK_PAGE_TOKEN"
BACKLOG = 16


@dataclass(frozen=True)
class Place:
    """A listening socket and the token that its address holds."""

    listener: socket.socket
    token: str

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{LOCAL}:{self.listener.getsockname()[1]}/{self.token}/"

    @property
    def environment(self) -> dict[str, str]:
        """How a process that inherits the socket learns of it."""
        return {SOCKET: str(self.listener.fileno()), TOKEN: self.token}


def made(port: int = 0) -> Place:
    """A new place on a port, 0: a free one. Raises InputError where the port is taken."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((LOCAL, port))
    except OSError as error:
        listener.close()
        raise InputError(
            f"the page cannot have port {port}: {error.strerror}; choose another, or 0 for a free one"
        ) from None
    listener.listen(BACKLOG)
    return Place(listener, secrets.token_urlsafe(24))


def inherited() -> Place | None:
    """The place that the start script made; None for a page that was started by hand."""
    number, token = os.environ.pop(SOCKET, ""), os.environ.pop(TOKEN, "")
    if not (number and token):
        return None
    return Place(socket.socket(fileno=int(number)), token)
