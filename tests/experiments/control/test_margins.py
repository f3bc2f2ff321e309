from __future__ import annotations

import numpy as np
import pytest

from experiments.control.margins import clause_label, clause_violations, limit_violations
from mobee.robot.load import load_robot

ICUB = load_robot("icub")


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


def test_a_clause_is_told_in_words() -> None:
    labels = [clause_label(ICUB, i) for i in range(len(ICUB.clauses))]
    assert "-1 elbow > -90 or -1 wrist_prosup > -45" in labels
