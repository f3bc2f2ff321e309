# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from mobee_cli.__main__ import main
from tests.mobee.check.arm import ARM
from tests.mobee.robot.robot_files import robot_file
from tests.mobee.robot.urdf_files import arm_with

pytest.importorskip("rerun")
from services.monitor.viewer.files import program

BALL = '<World><sphere name="ball" radius="0.03" px="-0.37" pz="0.1"/></World>'


def test_a_recording_holds_robot_world_and_contacts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot, world, saved = robot_file(tmp_path, *ARM.splitlines()), tmp_path / "world.xml", tmp_path / "toy.rrd"
    world.write_text(BALL)
    assert main(["view", str(robot), "--world", str(world), "--save", str(saved)]) == 0
    assert capsys.readouterr().out == f"{saved}: open it with `rerun {saved}`\n"
    private = {**os.environ, "XDG_CONFIG_HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path)}
    stats = subprocess.run([str(program()), "rrd", "stats", str(saved)], capture_output=True, text=True, check=True, env=private)
    shown = {line.split(":")[0] for line in stats.stdout.splitlines() if line.startswith("/")}
    assert {"/robot/bend", "/robot/bend/solids/fore", "/world/ball", "/contacts", "/plots/motors", "/events"} <= shown


@pytest.mark.parametrize("most", [1000, 20_000])
def test_a_recording_that_does_not_fit_on_the_disk_is_an_error(most: int, tmp_path: Path) -> None:
    robot, saved = robot_file(tmp_path, *ARM.splitlines()), tmp_path / "toy.rrd"
    code = f"""import resource, sys; from mobee_cli.__main__ import main; resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))
sys.exit(main(["view", {str(robot)!r}, "--save", {str(saved)!r}]))"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 3 and done.stdout == "" and "Traceback" not in done.stderr
    assert done.stderr.startswith("mobee view: ") and done.stderr.count("\n") == 1 and str(saved) in done.stderr
    assert list(tmp_path.glob("*.rrd*")) == []


def test_a_page_is_served_until_it_is_interrupted(tmp_path: Path) -> None:
    robot = robot_file(tmp_path, *ARM.splitlines())
    command = [sys.executable, "-m", "mobee_cli", "view", str(robot)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as shown:
        assert shown.stdout and shown.stderr
        address = re.fullmatch(r"toy at (http://127\.0\.0\.1:\d+/viewer\.html\?recording=view\.rrd)\n", shown.stdout.readline())
        assert address
        with urllib.request.urlopen(address[1], timeout=30.0) as answer:
            assert b"<html" in answer.read(2000).lower()
        shown.send_signal(signal.SIGINT)
        try:
            assert shown.wait(timeout=20) == 0
        finally:
            shown.kill()  # or the end of `with` waits indefinitely
        assert "Traceback" not in shown.stderr.read()


def test_without_the_viewer_the_message_has_the_installation_command(tmp_path: Path) -> None:
    """In a process in which rerun cannot be imported, as if it were not installed."""
    code = "import sys; sys.modules['rerun'] = None; from mobee_cli.__main__ import main; sys.exit(main(['view', 'katana']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 3
    assert done.stderr == 'mobee view: a view needs rerun-sdk: pip install "mobee[viz]"\n'


def test_invalid_input_is_refused_in_a_single_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", "icubb"]) == 2
    assert "Did you mean 'icub'" in capsys.readouterr().err
    assert main(["view", "katana", "--save", str(tmp_path / "missing" / "out.rrd")]) == 2
    assert "create it" in capsys.readouterr().err
    assert main(["view", "katana", "--save", str(tmp_path / "out.png")]) == 2
    assert "ends in .rrd" in capsys.readouterr().err


def test_the_fields_grown_around_a_urdf_are_shown(tmp_path: Path) -> None:
    saved = tmp_path / "toy.rrd"
    assert main(["view", str(arm_with(tmp_path, '<sphere radius="0.1"/>')), "--field", "0.03", "--save", str(saved)]) == 0
    assert b"palm_field" in saved.read_bytes()


def test_a_recording_that_cannot_be_written_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "folder.rrd").mkdir()
    for path in (tmp_path / "folder.rrd", Path("/proc/x.rrd")):
        assert main(["view", "katana", "--save", str(path)]) == 2
        said = capsys.readouterr().err
        assert f"--save {path}: cannot be written (" in said and said.count("\n") == 1


def test_a_refused_robot_leaves_no_recording(tmp_path: Path) -> None:
    old = tmp_path / "old.rrd"
    old.write_text("old")
    for name in ("new.rrd", "old.rrd"):
        assert main(["view", "icubb", "--save", str(tmp_path / name)]) == 2
    assert list(tmp_path.iterdir()) == [old] and old.read_text() == "old"
