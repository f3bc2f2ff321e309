# SPDX-License-Identifier: Apache-2.0
"""The web server of the page: its answers, and the clients that it accepts."""

from __future__ import annotations

import http.client
import json
import resource
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from services.monitor.web.board import Board
from services.monitor.web.record import Record, entries
from services.monitor.web.server import PageServer, Refused, Site


class Asked:
    """Controls that record the requests."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, str, dict[str, Any]]] = []

    def do(self, page: str, verb: str, arguments: dict[str, Any]) -> str:
        self.calls.append((page, verb, arguments))
        if verb == "fly":
            raise Refused("it has no wings")
        if verb == "break":
            raise ValueError("a defect")
        return "done"

    def tend(self, open_pages: set[str]) -> None:
        pass


@pytest.fixture
def served() -> Iterator[tuple[PageServer, Asked]]:
    controls = Asked()
    server = PageServer(Site(Board(), "secret", controls, None, None, lambda: 12.0), "127.0.0.1", 0)
    yield server, controls
    server.close()


def ask(server: PageServer, method: str, path: str, body: object = None, **headers: str) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20.0)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, None if body is None else json.dumps(body), given)
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


CALL = {"page": "p", "verb": "pause", "arguments": {}}


def test_the_page_may_load_nothing_from_elsewhere(served: tuple[PageServer, Asked]) -> None:
    status, headers, page = ask(served[0], "GET", "/")
    assert status == 200 and b"<title>MoBeE" in page
    assert "default-src 'self'; connect-src 'self'" in headers["Content-Security-Policy"]
    files = Path(__file__).parents[3] / "services" / "monitor" / "web" / "files"
    for file in files.iterdir():
        assert "//" not in file.read_text().replace("// ", "").replace("//\n", ""), f"{file} has an address"


def test_a_defect_in_a_call_is_printed_and_a_browser_that_leaves_is_not(
    served: tuple[PageServer, Asked], capfd: pytest.CaptureFixture[str]
) -> None:
    server = served[0]
    with pytest.raises(http.client.RemoteDisconnected):
        ask(server, "POST", "/do", CALL | {"verb": "break"}, X_Key="secret")
    assert "ValueError: a defect" in capfd.readouterr().err
    try:
        raise ConnectionResetError("the browser has left")
    except ConnectionResetError:
        server._server.handle_error(None, ("127.0.0.1", 1))
    assert capfd.readouterr().err == ""


def test_a_call_without_the_key_or_from_another_page_is_refused(served: tuple[PageServer, Asked]) -> None:
    server, controls = served
    assert ask(server, "POST", "/do", CALL)[0] == 403
    assert ask(server, "POST", "/do", CALL, X_Key="wrong")[0] == 403
    assert ask(server, "POST", "/do", CALL, X_Key="secret", Origin="http://example.org")[0] == 403
    assert controls.calls == []
    status, _, body = ask(server, "POST", "/do", CALL, X_Key="secret", Origin=f"http://127.0.0.1:{server.port}")
    assert (status, json.loads(body)) == (200, {"ok": True, "text": "done"})
    assert controls.calls == [("p", "pause", {})]


@pytest.mark.parametrize("host", ["example.org", "example.org:80", "127.0.0.1.example.org:80"])
def test_another_name_of_the_host_is_refused(served: tuple[PageServer, Asked], host: str) -> None:
    assert ask(served[0], "GET", "/", Host=host)[0] == 403
    assert ask(served[0], "POST", "/do", CALL, X_Key="secret", Host=host)[0] == 403


def test_a_refusal_and_an_invalid_call_are_said(served: tuple[PageServer, Asked]) -> None:
    _, _, body = ask(served[0], "POST", "/do", CALL | {"verb": "fly"}, X_Key="secret")
    assert json.loads(body) == {"ok": False, "text": "it has no wings"}
    assert ask(served[0], "POST", "/do", [1], X_Key="secret")[0] == 400
    assert ask(served[0], "GET", "/../config.py")[0] == 404
    assert ask(served[0], "GET", "/news?after=many")[0] == 400


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"X_Key": "s\u00e9cret"}, 403),
        ({"Content_Length": "many"}, 400),
        ({"Content_Length": "-1"}, 400),
        ({"Content_Length": "9" * 5000}, 413),
    ],
)
def test_headers_that_no_page_sends_are_refused(served: tuple[PageServer, Asked], headers: dict[str, str], status: int) -> None:
    server, controls = served
    assert ask(server, "POST", "/do", CALL, **{"X_Key": "secret"} | headers)[0] == status
    assert controls.calls == []


def test_a_reader_gets_what_changed_and_skips_what_it_missed() -> None:
    board = Board()
    board.put("body", 1)
    board.put("story", "a")
    first = json.loads(board.news(0, 0.0))
    assert first == {"version": 2, "body": 1, "story": "a"}
    board.put("story", "a")  # no change
    for pose in (2, 3, 4):
        board.put("body", pose)
    assert json.loads(board.news(first["version"], 0.0)) == {"version": 5, "body": 4}
    assert json.loads(board.news(1000, 0.0))["body"] == 4  # the monitor was started again


def test_a_reader_waits_for_news() -> None:
    board = Board()
    threading.Timer(0.2, board.put, ("body", 1)).start()
    begin = time.monotonic()
    assert json.loads(board.news(0, 20.0))["body"] == 1
    assert time.monotonic() - begin < 15.0
    assert json.loads(board.news(1, 0.01)) == {"version": 1}


def test_news_say_how_late_the_page_is(served: tuple[PageServer, Asked]) -> None:
    served[0].site.board.put("body", 1)
    _, _, body = ask(served[0], "GET", "/news?after=0&page=p&body=11.5&viewer=10")
    assert json.loads(body)["late"] == {"body": 0.5, "viewer": 2.0}
    assert served[0].site.pages.open() == {"p"}


def test_the_end_waits_until_open_pages_have_shown_it(served: tuple[PageServer, Asked]) -> None:
    server, board = served[0], served[0].site.board
    board.put("status", "runs")
    ask(server, "GET", "/news?after=0&page=p")
    board.put("status", "ended")
    threading.Timer(0.2, ask, (server, "GET", "/news?after=2&page=p")).start()
    assert not server.site.pages.have_shown(2)
    begin = time.monotonic()
    server.let_pages_show(20.0)
    assert time.monotonic() - begin < 15.0
    assert server.site.pages.have_shown(2)
    board.put("status", "gone")  # an answer to the page that still waits


def test_a_record_is_read_as_it_was_written_also_if_its_end_was_cut_off(tmp_path: Path) -> None:
    times = iter((0.0, 0.5, 1.0))
    record = Record(tmp_path / "story.jsonl", lambda: next(times))
    board = Board(record.put)
    board.put("cards", [{"part": "arm"}])
    board.put("body", 1)  # not recorded
    board.record("q", [0.1])
    record.close()
    with (tmp_path / "story.jsonl").open("a") as file:
        file.write('[2.0,"cards",[{"pa')
    assert [(one.time, one.name, one.value) for one in entries(tmp_path / "story.jsonl")] == [
        (0.0, "cards", [{"part": "arm"}]),
        (1.0, "q", [0.1]),
    ]


def test_a_record_that_is_continued_begins_after_the_last_complete_line(tmp_path: Path) -> None:
    path = tmp_path / "story.jsonl"
    path.write_text('[1.0,"q",1]\n[2.0,"cards",[{"pa')
    record = Record(path, lambda: 3.0)
    record.put("q", "2")
    record.close()
    assert [(one.time, one.value) for one in entries(path)] == [(1.0, 1), (3.0, 2)]


@pytest.mark.parametrize(
    ("clock", "continued"),
    [
        ((0.0, 7.0, 8.0), (5.0, 7.0, 8.0)),  # the monitor was started again
        ((0.0, 0.5, 2.0), (5.0, 5.0, 6.5)),  # the robot too, which began a new run
    ],
)
def test_the_times_of_a_record_that_is_continued_never_decrease(
    tmp_path: Path, clock: tuple[float, ...], continued: tuple[float, ...]
) -> None:
    path, times = tmp_path / "story.jsonl", iter(clock)
    path.write_text('[4.0,"q",[0.1]]\n[5.0,"q",[0.2]]\n')
    record = Record(path, lambda: next(times))
    for _ in clock:
        record.put("q", "[0.3]")
    record.close()
    assert [one.time for one in entries(path)] == [4.0, 5.0, *continued]


def test_a_record_on_a_full_disk_loses_values_and_continues_when_there_is_room(tmp_path: Path) -> None:
    path = tmp_path / "story.jsonl"
    record = Record(path, lambda: 0.0)
    record.put("q", "1")
    record.flush()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 5, limits[1]))
    try:
        record.put("q", "2")
        record.flush()
        assert record.trouble == "File too large"
        record.put("cards", json.dumps("long" * 50_000))
        assert [one.value for one in entries(path)] == [1]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    record.put("q", "3")
    record.close()
    assert record.trouble == ""
    assert [one.value for one in entries(path)] == [1, 3]
