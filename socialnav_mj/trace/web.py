"""rerun's web viewer for this machine alone: its page, handed on with a policy that lets it load from here only.

The viewer's own server would do, but its page asks elsewhere for fonts, newer versions, examples and statistics.
"""

import os
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.parse import urlencode, urlsplit
from urllib.request import urlopen

from socialnav_mj.trace.start import HOST, viewer_command, viewer_environment

POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' data: blob:; worker-src 'self' blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_FILES = "/files/"
_PATIENCE = 60.0
"""Until the viewer's own server answers [s]."""


@contextmanager
def web_viewer(paths: Sequence[Path], port: int) -> Iterator[str]:
    """Serve recordings and the viewer that shows them, for as long as the block lasts.

    Args:
        paths: Recordings, in the viewer's order.
        port: Where a browser finds them; 0 for any that is free.

    Yields:
        Address for the browser.

    Raises:
        OSError: If the port is taken.
        RuntimeError: If the viewer does not start.
    """
    server = _Server((HOST, port), _Handler)
    server.recordings = list(paths)
    upstream, data = _free_port(), _free_port()
    server.upstream = f"http://{HOST}:{upstream}"
    command = viewer_command([], web_port=upstream, port=data)
    nothing = subprocess.DEVNULL
    try:
        # A group of its own: the program that is started is a wrapper, and what it starts has to end with it.
        with subprocess.Popen(
            command, env=viewer_environment(), stdout=nothing, stderr=nothing, start_new_session=True
        ) as viewer:
            try:
                _wait_for(server.upstream, viewer)
                threading.Thread(target=server.serve_forever, daemon=True).start()
                yield f"http://{HOST}:{server.server_port}"
                server.shutdown()
            finally:
                with suppress(ProcessLookupError):
                    os.killpg(viewer.pid, signal.SIGTERM)
    finally:
        server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    recordings: list[Path]
    upstream: str


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        """Recordings from their files, everything else from the viewer's own server."""
        here = f"{HOST}:{self.server.server_port}"
        if self.headers.get("Host") != here:  # another site's name that was made to mean this machine
            self._answer(403, "text/plain", b"this address is for this machine alone\n")
        elif self.path == "/":
            addresses = [f"http://{here}{_FILES}{k}/{p.name}" for k, p in enumerate(self.server.recordings)]
            query = urlencode([*(("url", address) for address in addresses), ("hide_welcome_screen", "1")])
            self._answer(302, "text/plain", b"", location=f"/?{query}")
        elif self.path.startswith(_FILES):
            self._recording(self.path.removeprefix(_FILES).partition("/")[0])
        else:
            self._hand_on()

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""

    def _recording(self, place: str) -> None:
        if not place.isdecimal() or int(place) >= len(self.server.recordings):
            self._answer(404, "text/plain", b"no such recording\n")
            return
        self._answer(200, "application/octet-stream", self.server.recordings[int(place)].read_bytes())

    def _hand_on(self) -> None:
        try:
            with urlopen(self.server.upstream + urlsplit(self.path).path) as found:
                self._answer(200, found.headers.get("Content-Type", "application/octet-stream"), found.read())
        except HTTPError as error:
            self._answer(error.code, "text/plain", b"")
        except URLError:
            self._answer(502, "text/plain", b"the viewer has ended\n")

    def _answer(self, status: int, kind: str, content: bytes, *, location: str = "") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", POLICY)
        if location:
            self.send_header("Location", location)
        self.end_headers()
        self.wfile.write(content)


def _free_port() -> int:
    with socket.socket() as one:
        one.bind((HOST, 0))
        return int(one.getsockname()[1])


def _wait_for(address: str, viewer: "subprocess.Popen[bytes]") -> None:
    until = time.monotonic() + _PATIENCE
    while time.monotonic() < until and viewer.poll() is None:
        try:
            with urlopen(address):
                return
        except URLError:
            time.sleep(0.1)
    raise RuntimeError(f"rerun's web viewer did not start (exit code {viewer.poll()})")
