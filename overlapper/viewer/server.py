"""The meshcat server of a live view, in a process of its own.

It listens on one address of the machine, while meshcat's own server listens on all addresses.
"""

from __future__ import annotations

import signal
import socket
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from typing import Any

from meshcat.servers.zmqserver import ZMQWebSocketBridge
from meshcat.visualizer import ViewerWindow


def must_be_here(host: str) -> None:
    """Raises ValueError unless `host` is an address of this machine."""
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with closing(socket.create_server((host, 0), family=family)):
            pass
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not a valid name"
        raise ValueError(f"host must be an address of this machine, not {host!r}: {reason}") from error


def serve(host: str) -> Iterator[tuple[str, str]]:
    """Yields the addresses for drawing and for viewing, and then runs the server; called in the server's process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the view, and the view ends the server
    bridge = _Bridge(host)
    yield bridge.zmq_url, bridge.seen_at()
    bridge.run()


class Window(ViewerWindow):  # type: ignore[misc]
    """The connection over which a view draws."""

    def __init__(self, drawn_at: str, seen_at: str) -> None:
        self.server_proc = None
        self.zmq_url, self.web_url = drawn_at, seen_at
        self.connect_zmq()


class _Bridge(ZMQWebSocketBridge):  # type: ignore[misc]
    """It accepts drawings only from this machine, whatever address it is viewed at."""

    def __init__(self, seen_by: str) -> None:
        self._seen_by = seen_by
        super().__init__()

    def make_app(self) -> Any:
        app = super().make_app()
        app.listen = partial(app.listen, address=self._seen_by)
        return app

    def seen_at(self) -> str:
        everywhere = {"0.0.0.0": "127.0.0.1", "::": "::1"}
        host = everywhere.get(self._seen_by, self._seen_by)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.fileserver_port}/static/"
