"""Passes the page's address from the start script to the page's process.

The start script opens the socket and creates the access token, and passes both to the page's process. The
token is passed in the environment, which only the same user can read; parameter files and logs may be
readable by everyone. The socket remains open if the page ends, so that a restarted page keeps its address.
"""

from __future__ import annotations

import os
import socket

from deeptruck_core.pages.local import Place

SOCKET, TOKEN = "DEEPTRUCK_PAGE_SOCKET", "DEEPTRUCK_PAGE_TOKEN"


def environment(place: Place) -> dict[str, str]:
    """Environment variables that describe the inherited socket to a process."""
    return {SOCKET: str(place.listener.fileno()), TOKEN: place.token}


def inherited() -> Place | None:
    """The address from the start script; None for a page that was started by hand."""
    number, token = os.environ.pop(SOCKET, ""), os.environ.pop(TOKEN, "")
    if not (number and token):
        return None
    return Place(socket.socket(fileno=int(number)), token)
