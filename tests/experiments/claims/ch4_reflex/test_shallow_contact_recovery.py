# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.claims.ch4_reflex.shallow_contact_paths import BEFORE, BEHIND, MARKER, SPEED, STEP, Client, HandPath, Spot, Table
from experiments.claims.ch4_reflex.shallow_contact_recovery import VARIANTS, Control, Trial, holds, run_trial

CLEAN = Trial("naive", 90.0, 0, 0, 0.01, 0.0, 0.5, 1.0, 0.0, 3, False, False, False, False, False, False, 0.05)


@pytest.fixture(scope="module")
def table() -> Table:
    return Table()


@pytest.fixture(scope="module")
def steep(table: Table) -> tuple[Table, HandPath]:
    path = table.path(table.spots(1, seed=0)[0], np.deg2rad(90.0))
    assert path is not None
    return table, path


@pytest.fixture(scope="module")
def spot(table: Table) -> Spot:
    return table.spots(1, seed=3)[0]


@pytest.mark.parametrize("angle", [90.0, 20.0, 2.0])
def test_a_path_goes_straight_into_the_table_at_its_angle(table: Table, spot: Spot, angle: float) -> None:
    path = table.path(spot, np.deg2rad(angle))
    assert path is not None
    palm = table.model.evaluate(path.postures).position(MARKER)[path.start :]
    step = (palm[-1] - palm[0]) / (BEFORE + BEHIND)
    assert np.arcsin(-step[2]) == pytest.approx(np.deg2rad(angle), abs=0.005)
    straight = palm[0] + np.linspace(0.0, 1.0, len(palm))[:, None] * (palm[-1] - palm[0])
    assert np.abs(palm - straight).max() < 5e-4


def test_contact_begins_where_the_path_says(table: Table, spot: Spot) -> None:
    path = table.path(spot, np.deg2rad(45.0))
    assert path is not None
    touching = [bool(table.watch.check(table.model.evaluate(q))) for q in path.postures]
    first = path.start + round(BEFORE / STEP)
    assert not any(touching[: first - 1])
    assert all(touching[first + 1 :])


def test_the_client_drives_at_a_share_of_full_speed(table: Table, spot: Spot) -> None:
    path = table.path(spot, np.deg2rad(10.0))
    assert path is not None
    client = Client(table.robot, path, dt=0.01)
    references = []
    while not client.is_over:
        references.append(client.next())
    speeds = np.abs(np.diff(references, axis=0)) / 0.01 / [motor.max_velocity for motor in table.robot.motor_table]
    assert speeds.max() == pytest.approx(SPEED, rel=1e-6)
    assert client.runs == 1


def test_in_steep_contacts_the_mended_reflex_recovers_and_the_controller_settles(steep: tuple[Table, HandPath]) -> None:
    found = {variant: run_trial(*steep, variant, 90.0, 0, 0) for variant in VARIANTS}
    assert found["off"].depth > 0.035
    assert found["mended"].recovered
    assert found["mended"].reflexes > 1  # the client insists
    assert found["2.0"].settled
    assert found["2.0"].switches == 0
    assert max(found[variant].depth for variant in VARIANTS[1:]) < 0.02


def test_a_recovery_is_clean_without_contact_during_the_motion_back() -> None:
    assert CLEAN.clean
    flickers = replace(CLEAN, again=True)
    assert flickers.recovered
    assert not flickers.clean
    for fault in ("came_back", "never", "deeper", "relapse"):
        assert not replace(CLEAN, **{fault: True}).recovered
    assert not replace(CLEAN, reflexes=0).recovered


def test_a_reflex_that_follows_at_once_is_a_relapse() -> None:
    assert Control(taken=[100, 130], given=[120, 150]).relapsed
    assert not Control(taken=[100, 190], given=[120, 200]).relapsed
    assert not Control(taken=[100], given=[120]).relapsed
    assert Control(taken=[100, 130], given=[120]).switches == 3


def claimed() -> list[Trial]:
    """Trials that are as the claim says."""
    low = {"angle": 1.0}
    return [
        CLEAN,
        replace(CLEAN, **low, relapse=True, switches=9.0),
        replace(CLEAN, variant="mended"),
        replace(CLEAN, **low, variant="mended"),
        replace(CLEAN, variant="2.0", settled=True),
        replace(CLEAN, **low, variant="2.0", settled=True),
    ]


def test_the_claim_fails_with_any_of_its_parts() -> None:
    trials = claimed()
    assert holds(trials)
    for index, change in (
        (1, {"relapse": False}),
        (3, {"relapse": True}),
        (3, {"switches": 9.0}),
        (4, {"settled": False}),
        (5, {"solid": 0.001}),
    ):
        spoiled = list(trials)
        spoiled[index] = replace(spoiled[index], **change)
        assert not holds(spoiled)
