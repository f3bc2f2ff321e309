# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib.util
import json
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import mobee._core
from mobee._core import CoreUnavailable
from mobee_cli.__main__ import VERBS, main


def examined(capsys: pytest.CaptureFixture[str], port: int) -> tuple[int, dict[str, dict[str, Any]]]:
    code = main(["doctor", "--json", "--endpoint", f"tcp/127.0.0.1:{port}"])
    return code, {one["subject"]: one for one in json.loads(capsys.readouterr().out)}


def test_each_subject_has_a_verdict_and_each_fault_a_remedy(free_port: int, capsys: pytest.CaptureFixture[str]) -> None:
    code, found = examined(capsys, free_port)
    assert {"Python", "processor", "memory", "folder", "native core", "extra live", "extra viz", "OpenGL", "systems"} <= set(found)
    assert found["Python"]["verdict"] == found["native core"]["verdict"] == found["extra live"]["verdict"] == "ok"
    assert found["systems"]["found"] == f"none runs at tcp/127.0.0.1:{free_port}"
    assert found[f"port {free_port}"] == {"subject": f"port {free_port}", "verdict": "ok", "found": "free", "remedy": ""}
    assert all(one["remedy"] for one in found.values() if one["verdict"] == "wrong")
    assert code == (3 if any(one["verdict"] == "wrong" for one in found.values()) else 0)


def test_a_missing_package_is_wrong_if_launch_needs_it(
    free_port: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name in ("rerun", "ompl", "pybullet") else find(name))
    code, found = examined(capsys, free_port)
    assert code == 3
    assert found["extra sim"]["verdict"] == "note" and "MuJoCo moves the iCub too" in found["extra sim"]["remedy"]
    assert (found["extra viz"]["verdict"], found["extra viz"]["remedy"]) == ("wrong", 'pip install "mobee[viz]"')
    assert (found["extra planning"]["verdict"], found["extra planning"]["found"]) == ("note", "ompl not installed")


def test_without_the_extra_live_doctor_names_the_command_that_installs_it() -> None:
    absent = "sys.modules['zenoh'] = sys.modules['msgspec'] = None"
    program = f"import sys; {absent}; from mobee_cli.__main__ import main; sys.exit(main(['doctor', '--json']))"
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    found = {one["subject"]: one for one in json.loads(ended.stdout)}
    assert (ended.returncode, found["extra live"]["remedy"]) == (3, 'pip install "mobee[live]"')
    assert found["systems"]["found"] == "not known without msgspec"


def test_a_port_in_use_and_a_core_that_is_missing_are_wrong(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def missing() -> None:
        raise CoreUnavailable("there is no core.so: python core/build.py builds it")

    monkeypatch.setattr(mobee._core, "library", missing)
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        code, found = examined(capsys, port)
    assert code == 3
    assert found["native core"]["verdict"] == "wrong" and "core/build.py builds it" in found["native core"]["remedy"]
    assert found[f"port {port}"]["remedy"] == f"mobee launch --endpoint tcp/127.0.0.1:{port + 1}"


def test_the_report_fits_80_columns(free_port: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    main(["doctor", "--endpoint", f"tcp/127.0.0.1:{free_port}"])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith("ok     Python            Python 3.")


@pytest.mark.skipif(shutil.which("bash") is None, reason="completes in bash")
def test_a_shell_completes_verbs_options_and_scenarios(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "mobee.bash"
    script.write_text(capsys.readouterr().out)

    def completed(*words: str) -> list[str]:
        command = f'source {script}; COMP_WORDS=({" ".join(words)}); COMP_CWORD={len(words) - 1}; _shtab_mobee; echo "${{COMPREPLY[@]}}"'
        return subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True).stdout.split()

    assert set(VERBS) <= set(completed("mobee", '""'))
    assert completed("mobee", "concl") == [] and completed("mobee", "exper") == ["experiment"]
    assert completed("mobee", "launch", "kin") == ["kinematic"]
    assert completed("mobee", "reach", "--mar") == ["--marker"]
    assert completed("mobee", "topic", "sch") == ["schema"]
