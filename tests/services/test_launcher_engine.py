from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import pytest

from mobee.engine.cache import READY, cache_folder
from services.launcher import engine
from services.launcher.run import Options, launch


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[list[str]]:
    """What would be run; the cache is in a folder of its own."""
    started: list[list[str]] = []

    def run(argv: list[str], **_: Any) -> subprocess.CompletedProcess[bytes]:
        started.append(argv)
        return subprocess.CompletedProcess(argv, 9)

    monkeypatch.setenv("MOBEE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(subprocess, "run", run)
    return started


def test_a_compiled_engine_costs_no_process(runs: list[list[str]]) -> None:
    cache_folder().mkdir(parents=True)
    (cache_folder() / READY).touch()
    engine.compile_engine()
    assert runs == []


def test_an_engine_that_does_not_compile_is_said(runs: list[list[str]]) -> None:
    with pytest.raises(engine.EngineMissing, match="exit code 9"):
        engine.compile_engine()
    assert runs[0][1:] == ["-m", "mobee.engine"]


def test_a_cache_that_cannot_be_written_is_refused_before_half_a_minute_is_lost(runs: list[list[str]], monkeypatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("MOBEE_CACHE", str(tmp_path / "file"))
    with pytest.raises(engine.EngineMissing, match="MOBEE_CACHE"):
        engine.compile_engine()
    assert runs == []


def test_ctrl_c_while_the_engine_is_compiled_is_one_line(
    runs: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, free_port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: Any, process_group: int, **__: Any) -> None:
        assert process_group == 0  # the compiler hears no Ctrl-C of its own, of which it would print a traceback
        raise KeyboardInterrupt

    monkeypatch.setattr(subprocess, "run", interrupted)
    assert launch(Options(headless=True, endpoint=f"tcp/127.0.0.1:{free_port}", runs=tmp_path / "runs")) == 130
    said = capsys.readouterr().err
    assert said.startswith("mobee launch: interrupted before anything was started")
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "runs").exists()
