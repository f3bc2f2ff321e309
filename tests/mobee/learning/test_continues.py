# SPDX-License-Identifier: Apache-2.0
"""An agent that begins with what was learned on another plant."""

from __future__ import annotations

from pathlib import Path

import pytest

from mobee.errors import InvalidValue, MobeeError
from mobee.learning.agent import CuriousAgent
from mobee.learning.lattice import Lattice
from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.simulation.plant import OfflinePlant
from mobee.store import TransitionStore

ROBOT = load_robot("katana")
PART = ROBOT.motor_table[0].part
SPACE = Lattice(ROBOT, ROBOT.parts[PART].motors[:2], neighbours="equidistant")


def agent(folder: Path, name: str, dt: float = 0.02, seed: int = 0, continues: Path | None = None) -> CuriousAgent:
    plant = OfflinePlant(Model(ROBOT), seed=0, dt=dt)
    return CuriousAgent(SPACE, plant, seed=seed, store=TransitionStore(folder / name, PART), continues=continues)


def test_it_has_learned_what_the_first_had_and_continues(tmp_path: Path) -> None:
    first = agent(tmp_path, "first.sqlite")
    first.run(12)
    second = agent(tmp_path, "second.sqlite", dt=0.01, continues=tmp_path / "first.sqlite")
    assert second.transitions == 12 and (second.model.tries == first.model.tries).all()
    assert second.decide(first.state) == first.decide(first.state)
    second.interrupt()
    second.run(3)
    assert second.store is not None
    record = second.store.settings()
    assert record["continued"]["transitions"] == 12
    assert (record["continued"]["plant"]["dt"], record["plant"]["dt"]) == (0.02, 0.01)
    assert [made.n for made in second.store.load()] == list(range(1, 16))


def test_after_a_restart_it_goes_on_with_its_own_file_even_without_the_first(tmp_path: Path) -> None:
    agent(tmp_path, "first.sqlite").run(4)
    agent(tmp_path, "second.sqlite", dt=0.01, continues=tmp_path / "first.sqlite").run(3)
    (tmp_path / "first.sqlite").unlink()
    again = agent(tmp_path, "second.sqlite", dt=0.01, continues=tmp_path / "first.sqlite")
    assert again.transitions == 7
    with pytest.raises(MobeeError, match="plant = .*0.01.* on record, now .*0.02"):
        agent(tmp_path, "second.sqlite", continues=tmp_path / "first.sqlite")
    third = agent(tmp_path, "third.sqlite", continues=tmp_path / "second.sqlite")
    assert third.store is not None and third.store.settings()["continued"]["before"]["transitions"] == 4


def test_other_settings_and_other_agents_are_refused(tmp_path: Path) -> None:
    agent(tmp_path, "first.sqlite").run(2)
    with pytest.raises(MobeeError, match="first.sqlite: .* has seed = 0 on record, now 1"):
        agent(tmp_path, "second.sqlite", seed=1, continues=tmp_path / "first.sqlite")
    with pytest.raises(MobeeError, match=f"holds no transitions of tail. It holds those of {PART}"):
        TransitionStore(tmp_path / "third.sqlite", "tail").continue_from(tmp_path / "first.sqlite", {})
    assert TransitionStore(tmp_path / "second.sqlite", PART).load() == []
    with pytest.raises(InvalidValue, match="continues=.* needs a store"):
        CuriousAgent(SPACE, OfflinePlant(Model(ROBOT)), continues=tmp_path / "first.sqlite")
