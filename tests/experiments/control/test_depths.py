from __future__ import annotations

import numpy as np
import pytest

from experiments.control.depths import deepest, oscillation
from experiments.control.listed import is_listed
from experiments.control.ride import Ride
from mobee.model import Model
from mobee.robot.load import load_robot, load_world

ICUB = load_robot("icub")
DT = 0.01


def elbow_ride(angles: np.ndarray) -> Ride:
    q = np.tile(ICUB.home, (len(angles), 1))
    q[:, ICUB.motors.index("l_elbow")] += angles
    return Ride(q, np.zeros_like(q), DT)


def lever(model: Model) -> float:
    column = model.jacobian(ICUB.home, "left_palm")[:3, ICUB.motors.index("l_elbow")]
    return float(np.linalg.norm(column))


def test_an_oscillating_hand_is_measured() -> None:
    model, t = Model(ICUB), np.arange(0.0, 3.0, DT)
    found = oscillation(model, elbow_ride(1e-3 * np.sin(2.0 * np.pi * 2.0 * t)), "left_palm")
    assert found == pytest.approx(1e-3 * lever(model), rel=0.02)


def test_a_creeping_hand_does_not_oscillate() -> None:
    model, t = Model(ICUB), np.arange(0.0, 3.0, DT)
    assert oscillation(model, elbow_ride(0.01 * t), "left_palm") < 1e-4


def test_what_counts_is_told_apart_from_an_arm_beside_the_pelvis() -> None:
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
