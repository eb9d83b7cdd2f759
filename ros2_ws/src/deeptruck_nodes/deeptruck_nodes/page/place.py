"""How the page's process learns where the page is.

The start script makes the socket and the word that opens it, and hands them to the page's process. The word
goes by the environment, which only the same user can read; a parameter file or a log could be read by
everyone. The socket outlives a page that died: its address stays the same.
"""

from __future__ import annotations

import os
import socket

from deeptruck_model.pages.local import Place

SOCKET, TOKEN = "DEEPTRUCK_PAGE_SOCKET", "DEEPTRUCK_PAGE_TOKEN"


def environment(place: Place) -> dict[str, str]:
    """How a process that inherits the socket learns of it."""
    return {SOCKET: str(place.listener.fileno()), TOKEN: place.token}


def inherited() -> Place | None:
    """The place that the start script made; None for a page that was started by hand."""
    number, token = os.environ.pop(SOCKET, ""), os.environ.pop(TOKEN, "")
    if not (number and token):
        return None
    return Place(socket.socket(fileno=int(number)), token)
