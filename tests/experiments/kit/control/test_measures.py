# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.control.measures import clause_violations, deepest, is_listed, limit_violations, oscillation
from experiments.kit.control.plant_runs import PlantRun
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot

ICUB = load_robot("icub")
DT = 0.01


def with_motors(**degrees: float) -> np.ndarray:
    q = ICUB.home.copy()
    for motor, angle in degrees.items():
        q[ICUB.motors.index(motor)] = np.deg2rad(angle)
    return q


def test_a_cable_row_is_violated_by_the_distance_along_its_normal() -> None:
    q = with_motors(l_shoulder_roll=0.0, l_shoulder_yaw=-37.0)
    worst = np.rad2deg(clause_violations(ICUB, q[None])[0].max())
    assert worst == pytest.approx((37.0 - 66.6) / np.sqrt(2.0))  # roll + yaw > -66.6
    yaw = with_motors(l_shoulder_roll=0.0, l_shoulder_yaw=-80.0)
    assert np.rad2deg(clause_violations(ICUB, yaw[None])[0].max()) == pytest.approx((80.0 - 66.6) / np.sqrt(2.0))


def test_a_clause_with_a_satisfied_row_is_not_violated() -> None:
    bent_and_turned = with_motors(l_elbow=100.0, l_wrist_prosup=50.0)
    bent = with_motors(l_elbow=100.0, l_wrist_prosup=40.0)
    violations = np.rad2deg(clause_violations(ICUB, np.stack([bent_and_turned, bent])).max(axis=1))
    assert violations == pytest.approx([5.0, -5.0])


def test_beyond_a_limit_is_positive_and_inside_negative() -> None:
    q = np.stack([with_motors(l_elbow=110.0), with_motors(l_elbow=20.5)])
    elbow = ICUB.motors.index("l_elbow")
    assert np.rad2deg(limit_violations(ICUB, q)[:, elbow]) == pytest.approx([4.0, -5.0])


def elbow_run(angles: np.ndarray) -> PlantRun:
    q = np.tile(ICUB.home, (len(angles), 1))
    q[:, ICUB.motors.index("l_elbow")] += angles
    return PlantRun(q, np.zeros_like(q), DT)


def lever(model: Model) -> float:
    column = model.jacobian(ICUB.home, "left_palm")[:3, ICUB.motors.index("l_elbow")]
    return float(np.linalg.norm(column))


def test_an_oscillating_hand_is_measured() -> None:
    model, t = Model(ICUB), np.arange(0.0, 3.0, DT)
    found = oscillation(model, elbow_run(1e-3 * np.sin(2.0 * np.pi * 2.0 * t)), "left_palm")
    assert found == pytest.approx(1e-3 * lever(model), rel=0.02)


def test_a_creeping_hand_does_not_oscillate() -> None:
    model, t = Model(ICUB), np.arange(0.0, 3.0, DT)
    assert oscillation(model, elbow_run(0.01 * t), "left_palm") < 1e-4


def test_what_counts_is_separated_from_an_arm_beside_the_pelvis() -> None:
    model = Model(ICUB, load_world("table"))
    beside, below = ICUB.home.copy(), ICUB.home.copy()
    beside[ICUB.motors.index("torso_roll")] = np.deg2rad(10.0)
    below[ICUB.motors.index("torso_pitch")] = np.deg2rad(40.0)
    found = deepest(model, np.stack([ICUB.home, beside]))
    assert (found.solid, found.pair) == (0.0, "") and found.beside > 1e-3
    found = deepest(model, np.stack([ICUB.home, below]))
    assert found.solid > 0.01 and found.pair.endswith("in table") and found.field > found.solid


def test_contacts_with_the_world_always_count() -> None:
    assert is_listed("l_upper_arm_0", "table") and is_listed("chest_0", "some box")
    assert is_listed("l_hand_thumb_3_0", "r_hand_index_3_0") and not is_listed("root_link_3", "l_upper_arm_0")
