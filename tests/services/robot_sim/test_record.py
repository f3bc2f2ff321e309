from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.config import Config
from services.robot_sim.kinematic import KinematicBackend
from services.robot_sim.make import make_backend
from services.robot_sim.watch import CONTACTS, POSITIONS, Recorded

ROBOT = load_robot("icub")
DT = 0.01


class Touching(KinematicBackend):
    """Says that the hand is in the table, deeper with every tick."""

    depth = 0.0

    def step(self, dt: float) -> None:
        super().step(dt)
        self.depth += 1e-3

    def contacts(self) -> Mapping[str, float]:
        return {"l_hand table": self.depth} if self.depth > 1.5e-3 else {}


def recorded(folder: Path) -> Recorded:
    return Recorded(Touching(ROBOT, lambda: load_world("table"), MotorParameters(), 0), folder)


def positions(folder: Path) -> np.ndarray:
    return np.fromfile(folder / POSITIONS).reshape(-1, len(ROBOT.motors))


def test_a_row_a_tick_holds_the_joint_positions_at_its_end(tmp_path: Path) -> None:
    body, seen = recorded(tmp_path / "new"), []
    body.motors.command(slice(0, 3), "velocity", np.full(3, 0.2))
    for _ in range(20):
        body.step(DT)
        seen.append(body.motors.q.copy())
    assert np.array_equal(positions(tmp_path / "new"), seen)
    assert np.ptp(positions(tmp_path / "new")[:, 0]) > 0.01


def test_contacts_are_told_with_tick_pair_and_depth(tmp_path: Path) -> None:
    body = recorded(tmp_path)
    for _ in range(3):
        body.step(DT)
    assert (tmp_path / CONTACTS).read_text().splitlines() == ["k,pair,depth", "2,l_hand table,0.002", "3,l_hand table,0.003"]


def test_a_new_run_begins_a_new_record(tmp_path: Path) -> None:
    body = recorded(tmp_path)
    for _ in range(3):
        body.step(DT)
    body.reset(0)
    body.step(DT)
    assert len(positions(tmp_path)) == 1
    assert (tmp_path / CONTACTS).read_text().splitlines()[1] == "1,l_hand table,0.004"


def test_the_configuration_asks_for_it_and_a_folder_that_cannot_be_is_refused(tmp_path: Path) -> None:
    config = Config(backend="kinematic", record=str(tmp_path / "record"))
    make_backend(config, ROBOT).step(DT)
    assert len(positions(tmp_path / "record")) == 1
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidValue, match="record: cannot write"):
        make_backend(Config(backend="kinematic", record=str(tmp_path / "file")), ROBOT)
