# SPDX-License-Identifier: Apache-2.0
"""Measurements of the physics: counters, stops, recorded files."""

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
from services.robot_sim.kinematic import KinematicBackend, SolidContact
from services.robot_sim.make import make_backend
from services.robot_sim.watch import CONTACTS, POSITIONS, Counters, Recorded, Stops
from tests.services.robot_sim.gated import Gated


def test_the_oldest_command_of_a_tick_counts_and_holds_are_counted_apart() -> None:
    counters, fresh, old = Counters(), Gated().owned(), Gated().owned()
    idle = Gated()
    for _ in range(10):
        fresh.command()
        if fresh.k == 0:
            old.command(ttl=95)
        for gated in (fresh, old):
            gated.tick()
        counters.count_gates([fresh.gate, old.gate, idle.gate])
    numbers = counters.numbers(missed=0, pairs_watched=3)
    assert counters.ages == {age: 1 for age in range(1, 10)} | {1: 2}  # in the last tick `old` holds
    assert (numbers["armed_ticks"], numbers["hold_ticks"], numbers["ticks"]) == (9, 1, 10)
    assert (numbers["age_p50"], numbers["age_p99"], numbers["age_max"]) == (4, 9, 9)


def test_a_commanded_hold_is_a_hold_and_no_age() -> None:
    counters, gated = Counters(), Gated().owned()
    for mode in ("velocity", "hold", "hold"):
        gated.command(mode)
        gated.tick()
        counters.count_gates([gated.gate])
    numbers = counters.numbers(0, 0)
    assert (numbers["armed_ticks"], numbers["hold_ticks"], counters.ages) == (1, 2, {1: 1})


def test_without_a_command_there_is_no_age() -> None:
    counters = Counters()
    counters.count_gates([Gated().gate])
    numbers = counters.numbers(0, 0)
    assert (numbers["age_p99"], numbers["age_max"], numbers["armed_ticks"], numbers["hold_ticks"]) == (-1, -1, 0, 0)


def test_the_deepest_contact_and_the_closest_gap_are_kept() -> None:
    counters = Counters()
    for depth in (0.0, 0.002, 0.001):
        counters.count_contact(SolidContact(depth, "l_hand table"))
    for gap in (-1.0, 0.3, 0.1, -1.0):
        counters.count_gap(gap)
    numbers = counters.numbers(0, 0)
    assert (numbers["solid_depth_max"], numbers["solid_ticks"], numbers["gap_min"]) == (0.002, 2, 0.1)


def test_a_stop_is_timed_from_the_last_tick_under_command_to_rest() -> None:
    stops, q = Stops(), np.zeros(3)
    stops.note_command("torso", 0, q, moves=True)
    stops.note_command("torso", 10_000_000, q, moves=True)
    assert stops.note_hold("torso", 20_000_000, q + 0.01, moves=True) is None
    assert stops.note_hold("torso", 40_000_000, q + 0.02, moves=False) == pytest.approx((0.03, 0.02))
    assert stops.note_hold("torso", 50_000_000, q + 0.02, moves=False) is None
    assert stops.count == 1


def test_a_part_that_rested_under_command_does_not_stop() -> None:
    stops = Stops()
    stops.note_command("torso", 0, np.zeros(3), moves=True)
    stops.note_command("torso", 10_000_000, np.zeros(3), moves=False)
    assert stops.note_hold("torso", 20_000_000, np.zeros(3), moves=False) is None


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


def test_contacts_are_recorded_with_tick_pair_and_depth(tmp_path: Path) -> None:
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
