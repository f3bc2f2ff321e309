# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import io
import re
from pathlib import Path

import pytest

from bus_schema import VERSION
from bus_schema.rpc import Stat
from services.launcher.child import Child, Program
from services.launcher.screen import Screen


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def children() -> list[Child]:
    well = Child(Program("monitor", (), Path("monitor.log")), phase="ready", restarts=2)
    well.stat = Stat(
        v=VERSION,
        who="monitor",
        instance="i1",
        pid=1,
        uptime=1.0,
        ready=True,
        text="page at http://127.0.0.1:9090/?url=x y",
        numbers={},
        rejected={},
    )
    ill = Child(Program("model", (), Path("model.log")), phase="fault", reason="ended with code 1: " + "a long story " * 20)
    return [well, ill]


def lines_of(frame: str) -> list[str]:
    return re.sub(r"\x1b\[[\d;]*[A-Za-z]", "", frame).splitlines()


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (40, 10), (200, 50)])
def test_the_screen_fits_the_terminal(monkeypatch: pytest.MonkeyPatch, children: list[Child], columns: int, rows: int) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("LINES", str(rows))
    screen = Screen("a test")
    screen.add("FAULT: " + "something went wrong " * 10)
    screen.draw(children, Path("runs/x"))
    lines = lines_of(terminal.getvalue())
    assert max(map(len, lines)) < columns
    assert len(lines) < rows
    assert lines[-1] == "Ctrl-C stops everything."


@pytest.mark.parametrize("columns", [1, 2])
def test_a_terminal_that_is_too_narrow_does_not_end_the_launcher(
    monkeypatch: pytest.MonkeyPatch, children: list[Child], columns: int
) -> None:
    monkeypatch.setattr("sys.stderr", Terminal())
    monkeypatch.setenv("COLUMNS", str(columns))
    screen = Screen("a test")
    screen.add("all ready")
    screen.draw(children, Path("runs/x"))


def test_where_not_all_news_fit_the_newest_stay(monkeypatch: pytest.MonkeyPatch, children: list[Child]) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setenv("LINES", "12")
    screen = Screen("a test")
    for number in range(5):
        screen.add(f"news {number} " + "and what it means " * 5)
    screen.add("all ready")
    screen.draw(children, Path("runs/x"))
    assert [line[9:] for line in lines_of(terminal.getvalue())[-2:-1]] == ["all ready"]


def test_the_address_of_the_page_is_whole_where_it_just_fits(monkeypatch: pytest.MonkeyPatch, children: list[Child]) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    address = "http://127.0.0.1:9090/?url=x"
    monkeypatch.setenv("COLUMNS", str(len(address) + 1))
    Screen("a test").draw(children, Path("runs/x"))
    assert address in lines_of(terminal.getvalue())


def test_a_second_drawing_covers_the_first(monkeypatch: pytest.MonkeyPatch, children: list[Child]) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    screen = Screen("a test")
    screen.draw(children, Path("runs/x"))
    height = len(lines_of(terminal.getvalue()))
    screen.draw(children, Path("runs/x"))
    assert f"\x1b[{height}A" in terminal.getvalue()


def test_state_restarts_and_page_are_on_the_screen(monkeypatch: pytest.MonkeyPatch, children: list[Child]) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    Screen("a test").draw(children, Path("runs/x"))
    lines = lines_of(terminal.getvalue())
    assert "page   http://127.0.0.1:9090/?url=x" in lines
    rows = {line.split()[0]: line.split()[1:4] for line in lines if line}
    assert rows["monitor"] == ["ready", "-", "2"]
    assert rows["model"] == ["fault", "-", "0"]


def test_in_a_pipe_news_are_lines_and_nothing_is_drawn(capsys: pytest.CaptureFixture[str], children: list[Child]) -> None:
    screen = Screen("a test")
    screen.add("model is ready")
    screen.draw(children, Path("runs/x"))
    said = capsys.readouterr()
    assert said.err.endswith(" model is ready\n")
    assert len(said.err.splitlines()) == 1
    assert said.out == ""
