# SPDX-License-Identifier: Apache-2.0
"""The shipped robot_sim and the example keep the contract; every deliberately broken one is caught by the right check."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mobee.robot.load import load_robot
from mobee_cli.__main__ import main
from mobee_cli.conform.checks import CHECKS
from tests.services.harness import Rig, rig

ROOT = Path(__file__).parents[3]
BARE_CLIENT = ROOT / "examples" / "bus" / "bare_client.py"


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("conform"), load_robot("icub")) as made:
        yield made


@pytest.fixture(scope="module")
def robot(bus: Rig) -> Rig:
    """The example, with a switch for each fault."""
    bus.run("robot_sim", "-m", "tests.mobee_cli.conform.broken_robot", "--endpoint", bus.endpoint)
    return bus


def conform(bus: Rig, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, dict[str, str | None]]:
    code = main(["conform", bus.endpoint, "--json", *options])
    return code, {one["check"]: one["broken"] for one in json.loads(capsys.readouterr().out)}


def breaks(bus: Rig, fault: str) -> None:
    assert [answer.ok is not None for answer in bus.session.get(f"break/{fault}", timeout=5.0)] == [True]


def test_the_example_keeps_the_contract(robot: Rig, capsys: pytest.CaptureFixture[str]) -> None:
    breaks(robot, "none")
    code, found = conform(robot, capsys)
    assert found == {check.name: None for check in CHECKS}
    assert code == 0


@pytest.mark.parametrize(
    ("fault", "check", "says"),
    [
        ("slow", "ticks", "ticks come a second, and dt and rate say 150.0"),
        ("gaps", "ticks", "are not published"),
        ("degrees", "positions", "Are they degrees? The bus has rad."),
        ("nan", "streams", "NaN or infinity"),
        ("short", "streams", "Tick.q: 40 numbers, expected 41"),
        ("part", "parts", "a tick has the parts head, left_arm, right_arm"),
        ("order", "parts", "in the robot file their order is torso_yaw"),
        ("limits", "parts", "torso/meta has upper 1.74533 of torso_yaw; in the robot file it is 0.872665"),
        ("deaf", "obeys", "by velocity commands the first motor was to move by"),
        ("turned", "obeys", "by velocity commands the first motor was to move by"),
        ("eager", "hold", "a part in hold moves on command"),
        ("epoch", "refuses", "a command of an older epoch is obeyed"),
        ("seq", "refuses", "a command with a seq that was used before is obeyed"),
        ("age", "refuses", "a command that answers a tick half a second ago is obeyed"),
        ("future", "refuses", "a command that answers a tick of the future is obeyed"),
        ("step", "refuses", "a command that jumps by 0.1 rad is obeyed"),
        ("number", "refuses", "a command of 1.2 times the highest velocity is obeyed"),
        ("endless", "watchdog", "of the last command the gate is 'armed', not 'hold'"),
        ("same_epoch", "ownership", "each epoch must be larger than all before"),
        ("orphan", "owner-gone", "these parts are still armed: torso"),
        ("mindless", "model-gone", "these parts are still armed: torso, head, left_arm, right_arm"),
        ("half_mindless", "model-gone", "these parts are still armed: head, left_arm, right_arm"),
        ("unstoppable", "emergency-stop", "are not in gate 'estop'"),
        ("silent_stop", "emergency-stop", "does not repeat the stop"),
    ],
)
def test_each_breach_of_the_contract_is_reported(robot: Rig, capsys: pytest.CaptureFixture[str], fault: str, check: str, says: str) -> None:
    breaks(robot, fault)
    try:
        code, found = conform(robot, capsys, "--only", check)
    finally:
        breaks(robot, "none")
    assert code == 1
    assert says in str(found[check])


def test_the_report_fits_80_columns(robot: Rig, capsys: pytest.CaptureFixture[str]) -> None:
    breaks(robot, "order")
    try:
        assert main(["conform", robot.endpoint, "--only", "parts", "--only", "service"]) == 1
    finally:
        breaks(robot, "none")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("ok      service ") and lines[1].startswith("BROKEN  parts ")
    assert max(map(len, lines)) <= 80


def test_a_client_with_zenoh_and_msgpack_alone_reads_the_robot(robot: Rig) -> None:
    done = subprocess.run([sys.executable, str(BARE_CLIENT), "--endpoint", robot.endpoint], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "left_arm of icub: 16 motors, the first is l_shoulder_pitch" in done.stdout
    assert re.search(r"tick \d+: gate \w+, l_shoulder_pitch at -\d\.\d{3} rad; \d+ states in 1 s", done.stdout)


def test_a_running_controller_and_a_missing_robot_are_named(
    bus: Rig, robot: Rig, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bus.token("controller", "i1_real")
    try:
        assert main(["conform", bus.endpoint]) == 3
    finally:
        bus.drop_token("controller", "i1_real")
    assert "a controller is running, and conform plays the controller" in capsys.readouterr().err
    assert main(["conform", bus.endpoint, "--only", "tocks"]) == 2
    assert "Did you mean 'ticks'?" in capsys.readouterr().err


def test_the_shipped_robot_keeps_the_contract(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with rig(tmp_path, load_robot("icub")) as bus:
        bus.start("services.robot_sim", "robot_sim", "--backend", "kinematic")
        code, found = conform(bus, capsys)
    assert found == {check.name: None for check in CHECKS}
    assert code == 0
