# SPDX-License-Identifier: Apache-2.0
"""Controllers that begin anew, or with other settings."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from bus_schema import keys
from bus_schema.rpc import Empty
from services.common.worlds import robot_hash
from services.robot_sim.sensors import part_meta
from services.robot_sim.strength import with_torques
from tests.services.controller.stage import PARTS, ROBOT, Stage, near, refused, staged
from tests.services.harness import rig, wait_for


def test_a_new_controller_takes_all_parts_after_the_old_one_was_killed(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as made:
        first = staged(made)
        first.under_control()
        _, epoch = first.own("left_arm")
        gates = {part: gate.epoch for part, gate in first.sim.gates.items()}
        assert first.controller.stop(signal.SIGKILL) == -signal.SIGKILL
        for part in PARTS:  # as the gate does when the owner's token is gone
            first.sim.hold(part)
        first.controller = made.start("services.controller", "controller")
        k = made.bus.k
        first.play(lambda: first.statuses() == {"idle"} and first.motion("torso").k > k, "control again")
        assert all(gate.epoch > gates[part] for part, gate in first.sim.gates.items())
        refused("epoch", lambda: first.goal("left_arm", epoch, near("left_arm")))
        _, newer = first.own("left_arm", "agent_next")
        assert newer > epoch
        assert first.controller.stop() == 0


def test_position_commands_begin_at_the_measured_posture(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as made:
        stage = staged(made, "--modality", "position", "--gains", "default")
        stage.sim.q = ROBOT.home + 0.2 * (ROBOT.limits.mean(axis=1) - ROBOT.home)
        stage.sim.frozen = True
        stage.under_control()
        first = wait_for(lambda: stage.commands("right_arm"), "a command")[0]
        assert first.mode == "position"
        np.testing.assert_allclose(first.ref, stage.sim.of("right_arm"), atol=1e-3)


def test_torque_commands_keep_the_limits_that_the_simulator_states(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as made:
        weak = with_torques(ROBOT, {"l_*": 0.5})
        for part in PARTS:
            made.serve(keys.meta(part), Empty, lambda _, key: replace(part_meta(weak, key.split("/")[0]), robot_hash=robot_hash(ROBOT)))
        stage = staged(made, "--modality", "torque")
        stage.under_control()
        for part in ("left_arm", "right_arm"):
            stage.goal(part, stage.own(part)[1], near(part))
        stage.ticks(20)
        largest = {part: max(np.abs(command.ref).max() for command in stage.commands(part)) for part in ("left_arm", "right_arm")}
        assert largest["left_arm"] == 0.5 < largest["right_arm"]


@pytest.mark.parametrize(
    ("posture", "says"),
    [
        ("head = [0.0]", "it has 6 motors"),
        ("heat = [0.0]", "Did you mean 'head'?"),
        ("head = [9.0, 0.0, 0.0, 0.0, 0.0, 0.0]", "neck_pitch at 9 rad, its range is"),
    ],
)
def test_an_impossible_posture_is_refused_in_one_line(stage: Stage, tmp_path: Path, posture: str, says: str) -> None:
    settings = tmp_path / "controller.toml"
    settings.write_text(f"[posture]\n{posture}\n")
    program = stage.rig.spawn("-m", "services.controller", "--endpoint", stage.rig.endpoint, "--config", str(settings))
    assert program.wait(20.0) == 2
    assert says in program.says
    assert "Traceback" not in program.says
