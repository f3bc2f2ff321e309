from __future__ import annotations

import io
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from mobee.engine import load, progress


class Screen(io.StringIO):
    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self._terminal = terminal

    def isatty(self) -> bool:
        return self._terminal


def shown(terminal: bool, functions: int, monkeypatch: pytest.MonkeyPatch) -> str:
    screen = Screen(terminal)
    monkeypatch.setattr(sys, "stderr", screen)
    compiled = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=load.load)})
    other = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=pytest.raises)})
    with progress.Progress(Path("/cache")) as counter:
        for _ in range(functions):
            counter.on_start(compiled)
            counter.on_end(compiled)
            counter.on_end(other)
    return screen.getvalue()


def test_on_a_terminal_one_line_counts_the_engines_functions_and_goes_away(monkeypatch: pytest.MonkeyPatch) -> None:
    first, *counted, last = shown(True, 3, monkeypatch).split("\r\033[K")
    assert first.startswith("mobee: compiling the engine into /cache")
    assert [text.split(" of about ")[0] for text in counted[::2]] == ["mobee: 1", "mobee: 2", "mobee: 3"]
    assert last == "mobee: the engine is compiled, 0 s.\n"


def test_nothing_is_said_where_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(True, 0, monkeypatch) == ""


def test_in_a_file_lines_come_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(shown(False, 30, monkeypatch).splitlines()) == 2
    monkeypatch.setattr(progress, "PERIOD", 0.0)
    assert len(shown(False, 30, monkeypatch).splitlines()) == 2 + 60


def test_an_interruption_is_said_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    compiled = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=load.load)})
    with pytest.raises(KeyboardInterrupt), progress.Progress(Path("/cache")) as counter:
        counter.on_start(compiled)
        raise KeyboardInterrupt
    assert screen.getvalue().endswith("\r\033[Kmobee: interrupted; what is compiled so far is kept.\n")
