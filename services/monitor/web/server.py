# SPDX-License-Identifier: Apache-2.0
"""The web server of the monitor's page: sends its files, the new values on the `Board` and the 3D view, and receives commands.

It refuses requests that do not address it by a name of loopback, such as 127.0.0.1. Commands need the key, a secret word in the address of
the page. A page without the key shows everything, but cannot send commands.
"""

from __future__ import annotations

import hmac
import json
import mimetypes
import shutil
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

from services.monitor.web.board import Board

FILES = Path(__file__).with_name("files")
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
NEWS_PATIENCE = 5.0  # s that a request for news waits
FRAME_PATIENCE = 2.0  # s that a request for the 3D view waits
GONE = 6.0  # s without a request after which a page counts as closed
LARGEST_CALL, MOST_DIGITS = 20_000, 10  # bytes; of a length
NAMED = ("127.0.0.1", "localhost")  # under one name the page is served, under the other the viewer that it embeds
POLICY = (
    "default-src 'self'; connect-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-src {both}; frame-ancestors {both}"
)
"""Content security policy of the page: with it the browser itself refuses to load or send anything except from and to this server."""


class Refused(Exception):
    """Raised if a command of the page cannot be executed. The page shows the text of the exception to the user."""


class Controls(Protocol):
    """Executes the commands of the page."""

    def do(self, page: str, verb: str, arguments: dict[str, Any]) -> str:
        """Execute the command `verb` (such as "stop") of the page with the id `page`, and return a sentence for the user.

        `arguments`: values of the command, by name. Raises Refused if it cannot be executed.
        """

    def tend(self, open_pages: set[str]) -> None:
        """Do the regular work of the controls; called once per second.

        For example, if the page that has taken parts of the robot is closed, these parts are given back to their agents. `open_pages`: ids
        of the open pages.
        """


class Frames(Protocol):
    """A source of the data of the 3D view, as numbered frames."""

    def newest(self, after: int, patience: float) -> bytes:
        """Return the encoded data that a viewer needs after it has shown frame `after`; wait at most `patience` s for a newer frame.

        The bytes contain the number and time of the frame, and pieces of Rerun data; the format is described at
        `services.monitor.viewer.frames.Frames.newest`.
        """


@dataclass
class Pages:
    """The open pages. Each page chooses an id, which is the key of the three dicts.

    `seen`: monotonic time of its last request [s]. `shown`: newest version of the board (the values of the page) that it has shown. `late`:
    delays of its pictures behind the robot [s of robot time]: "body" (the page's own drawing) and "viewer" (the 3D view). `lock`: protects
    the fields.
    """

    seen: dict[str, float] = field(default_factory=dict)
    shown: dict[str, int] = field(default_factory=dict)
    late: dict[str, dict[str, float]] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def note(self, page: str, shown: int, late: dict[str, float]) -> None:
        """Store what a page has reported with a request.

        `page`: its id. `shown`: newest version of the board (the values of the page) that it has shown. `late`: delays of its pictures
        behind the robot [s of robot time]: "body" (the page's own drawing) and "viewer" (the 3D view), each only if it is shown.
        """
        with self.lock:
            self.seen[page], self.shown[page], self.late[page] = time.monotonic(), shown, late

    def open(self) -> set[str]:
        """Return the ids of the pages with a request in the last 6 s; forget all others."""
        with self.lock:
            for page in [page for page, when in self.seen.items() if time.monotonic() - when > GONE]:
                del self.seen[page], self.shown[page], self.late[page]
            return set(self.seen)

    def have_shown(self, version: int) -> bool:
        """Return whether every open page has shown the version `version` of the board (the values of the page), or a newer one."""
        return all(self.shown.get(page, version) >= version for page in self.open())


@dataclass(frozen=True)
class Site:
    """The content and the functions of the page that a `PageServer` serves.

    `board`: values of the page. `key`: secret word in the page's address; without it a page shows everything but cannot send commands.
    `controls`: executes commands. `frames`: data of the 3D view; None: no live 3D view. `viewer_file`: returns the path of a file of
    Rerun's viewer, by name; None: no viewer. `time`: returns the robot's time [s]. `others`: further files, by the name under which they
    are served. `seek`: executes a command of a replay's time line, given as query of a request; None: no replay. `surfaces`: returns the
    robot as triangles, encoded as by `services.monitor.web.surfaces.encoded`. `pages`: the open pages.
    """

    board: Board
    key: str
    controls: Controls
    frames: Frames | None
    viewer_file: Callable[[str], Path] | None
    time: Callable[[], float]
    others: Mapping[str, Path] = field(default_factory=dict)
    seek: Callable[[Mapping[str, str]], None] | None = None
    surfaces: Callable[[], bytes] = bytes
    pages: Pages = field(default_factory=Pages)


VIEWER_FILES = ("re_viewer.js", "re_viewer_bg.wasm")


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print the traceback of an exception in the handling of a request, unless the browser has closed its connection (OSError)."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class PageServer:
    """The web server of the page. It runs in threads of its own."""

    def __init__(self, site: Site, bind: str, port: int) -> None:
        """Start to serve `site` at the address `bind` and the port `port` (0: any free port). Raises OSError if the port cannot be used."""
        self.site = site
        self._server = _Server((bind, port), partial(_Handler, site))
        self.port = int(self._server.server_address[1])
        self._ends = threading.Event()
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True, name="page").start()
        threading.Thread(target=self._tend, daemon=True, name="tend").start()

    def let_pages_show(self, patience: float) -> None:
        """Wait until every open page has shown the newest values in `site.board`, but at most `patience` s."""
        version, give_up = self.site.board.version, time.monotonic() + patience
        while not self.site.pages.have_shown(version) and time.monotonic() < give_up:
            time.sleep(0.02)

    def close(self) -> None:
        """Stop the server and release its port."""
        self._ends.set()
        self._server.shutdown()
        self._server.server_close()

    def _tend(self) -> None:
        while not self._ends.wait(1.0):
            self.site.controls.tend(self.site.pages.open())


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    protocol_version = "HTTP/1.1"
    server_version, sys_version = "MoBeE", ""
    timeout = 60.0  # s without a request after which a connection is closed

    def __init__(self, site: Site, *arguments: Any) -> None:
        self._site = site
        super().__init__(*arguments)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Log nothing: there are many requests a second."""

    def do_GET(self) -> None:
        """Answer with a file, news, or a frame of the 3D view."""
        if not self._is_local():
            return
        address = urlsplit(self.path)
        query = {name: values[-1] for name, values in parse_qs(address.query).items()}
        name = address.path.lstrip("/") or "index.html"
        try:
            if name == "news":
                self._send_news(query)
            elif name == "frame":
                self._send_frame(query)
            elif name == "surfaces":
                self._send(HTTPStatus.OK, "application/octet-stream", self._site.surfaces())
            elif name == "seek" and self._site.seek is not None:
                self._site.seek(query)
                self._send(HTTPStatus.NO_CONTENT, "text/plain", b"")
            elif name in VIEWER_FILES and self._site.viewer_file is not None:
                self._send_file(self._site.viewer_file(name))
            elif name in self._site.others:
                self._send_file(self._site.others[name])
            elif "/" not in name and (FILES / name).is_file():
                self._send_file(FILES / name)
            else:
                self._send(HTTPStatus.NOT_FOUND, "text/plain", b"there is no such file\n")
        except ValueError:
            self._send(HTTPStatus.BAD_REQUEST, "text/plain", b"the query is not valid\n")

    def do_POST(self) -> None:
        """Execute the command that a page sends, such as "stop" or "goal", if the request contains the secret key from the page's address.

        Requests from another page, without the key, or in an invalid form are refused.
        """
        if not self._is_local() or not self._is_from_the_page():
            return
        given = self.headers.get("Content-Length") or "0"
        if not (given.isascii() and given.isdigit()):  # int() also takes signs, blanks and underscores
            self.close_connection = True
            self._answer(HTTPStatus.BAD_REQUEST, False, "the request has no valid length")
            return
        length = int(given) if len(given) < MOST_DIGITS else LARGEST_CALL + 1
        if length > LARGEST_CALL:
            self.close_connection = True
            self._answer(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, False, "the request is too long")
            return
        body = self.rfile.read(length)
        if not hmac.compare_digest(self.headers.get("X-Key", "").encode(), self._site.key.encode()):
            self._answer(HTTPStatus.FORBIDDEN, False, "this page can only show: open the address that the launcher prints, with its key")
            return
        try:
            asked = json.loads(body)
            page, verb, arguments = str(asked["page"]), str(asked["verb"]), dict(asked.get("arguments", {}))
        except (ValueError, KeyError, TypeError, RecursionError):
            self._answer(HTTPStatus.BAD_REQUEST, False, "the request is not valid")
            return
        try:
            self._answer(HTTPStatus.OK, True, self._site.controls.do(page, verb, arguments))
        except Refused as refused:
            self._answer(HTTPStatus.OK, False, str(refused))

    def _is_local(self) -> bool:
        """Return whether the browser asked for this machine by a name of the loopback interface; otherwise, also send a refusal.

        A page of the internet could make the user's browser send a request with another name.
        """
        host = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host", "")
        if host in LOOPBACK:
            return True
        self.close_connection = True
        self._send(HTTPStatus.FORBIDDEN, "text/plain", b"this page is served on loopback only: open it as 127.0.0.1\n")
        return False

    def _is_from_the_page(self) -> bool:
        origin = self.headers.get("Origin")
        if origin is None or urlsplit(origin).netloc == self.headers.get("Host"):
            return True
        self.close_connection = True
        self._answer(HTTPStatus.FORBIDDEN, False, "the request comes from another page")
        return False

    def _send_news(self, query: dict[str, str]) -> None:
        site, page, now = self._site, query.get("page", "")[:40], self._site.time()
        shown = {name: round(max(0.0, now - float(query[name])), 2) for name in ("body", "viewer") if query.get(name)}
        after = int(query.get("after", 0))
        if page:
            site.pages.note(page, after, shown)
        text = site.board.news(after, NEWS_PATIENCE)
        late = json.dumps({"late": shown})
        self._send(HTTPStatus.OK, "application/json", f"{text[:-1]},{late[1:]}".encode())

    def _send_frame(self, query: dict[str, str]) -> None:
        frames = self._site.frames
        data = b"" if frames is None else frames.newest(int(query.get("after", 0)), FRAME_PATIENCE)
        self._send(HTTPStatus.OK, "application/octet-stream", data)

    def _send_file(self, path: Path) -> None:
        kind = "text/javascript" if path.suffix == ".js" else mimetypes.guess_type(path.name)[0] or "application/octet-stream"
        self._head(HTTPStatus.OK, kind, path.stat().st_size, cache=path.name in VIEWER_FILES)
        with path.open("rb") as file:
            shutil.copyfileobj(file, self.wfile, 1 << 20)

    def _answer(self, status: HTTPStatus, ok: bool, text: str) -> None:
        self._send(status, "application/json", json.dumps({"ok": ok, "text": text}).encode())

    def _send(self, status: HTTPStatus, kind: str, data: bytes) -> None:
        self._head(status, kind, len(data))
        self.wfile.write(data)

    def _head(self, status: HTTPStatus, kind: str, length: int, cache: bool = False) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8" if kind.startswith("text/") else kind)
        self.send_header("Content-Length", str(length))
        self.send_header("Cache-Control", "max-age=3600" if cache else "no-store")
        port = self.headers.get("Host", "").rpartition(":")[2]
        both = " ".join(["'self'", *(f"http://{name}:{port}" for name in NAMED if port.isdecimal())])
        self.send_header("Content-Security-Policy", POLICY.format(both=both))
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")
        self.end_headers()
