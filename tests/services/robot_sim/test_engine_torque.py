# SPDX-License-Identifier: Apache-2.0
"""Torque mode of both engines: the iCub with the gears of the control law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee import Controller, Gains, Model
from mobee.arrays import Array
from mobee.control.law import FRICTION, Modality
from mobee.model.masses import gravity_torque
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.kinematic import Backend
from tests.services.robot_sim.engines import Engine

DT = 0.01  # s
ROBOT = load_robot("icub")
ALL = slice(None)
MODALITIES: tuple[Modality, ...] = ("velocity", "torque")

# both arms held out to the front, clear of the limits' forces
OUT = {"shoulder_pitch": -80.0, "shoulder_roll": 25.0, "elbow": 45.0, "wrist_pitch": -30.0}
SIDE = {"shoulder_pitch": -40.0, "shoulder_roll": 60.0, "elbow": 70.0, "wrist_pitch": -40.0}


def posture(arms: dict[str, float], **motors: float) -> Array:
    q = ROBOT.limits.mean(axis=1)
    q[:9] = ROBOT.home[:9]
    for name, angle in motors.items():
        q[ROBOT.motor_index(name)] = np.radians(angle)
    for name, angle in arms.items():
        for side in "lr":
            q[ROBOT.motor_index(f"{side}_{name}")] = np.radians(angle)
    return q


def standing(engine: Engine, q: Array, dt: float = DT) -> Backend:
    """The robot at rest at q."""
    motors = tuple(replace(motor, home=float(at)) for motor, at in zip(ROBOT.motor_table, q, strict=True))
    robot = replace(ROBOT, motor_table=motors)
    backend = engine(robot, lambda: load_world("table"), MotorParameters(encoder_noise=0.0), seed=0, dt=dt)
    for _ in range(10):
        backend.step(dt)
    return backend


def driven(backend: Backend, seconds: float, torque: Array | None = None, compensated: bool = True) -> Array:
    """The path (ticks, n) of a robot that gets `torque` and the torque that compensates its weight."""
    path = []
    for _ in range(round(seconds / DT)):
        weight = gravity_torque(ROBOT, backend.motors.q) if compensated else np.zeros(41)
        backend.motors.command(ALL, "torque", weight + (0.0 if torque is None else torque))
        backend.step(DT)
        path.append(backend.motors.q.copy())
    return np.array(path)


@pytest.mark.parametrize("dt", [0.005, 0.02])
def test_an_arm_held_out_stays_with_compensation_and_the_other_sags_without(engine: Engine, dt: float) -> None:
    backend = standing(engine, posture(OUT, torso_pitch=15.0), dt)
    compensated, loose, servoed = ROBOT.parts["left_arm"].slice, ROBOT.parts["right_arm"].slice, slice(0, 9)
    start = backend.motors.q.copy()
    for _ in range(round(1.0 / dt)):
        backend.motors.command(compensated, "torque", gravity_torque(ROBOT, backend.motors.q)[compensated])
        backend.motors.command(loose, "torque", np.zeros(16))
        backend.step(dt)
    moved = np.degrees(backend.motors.q - start)
    assert moved[ROBOT.motor_index("r_shoulder_pitch")] > 20.0
    assert np.abs(moved[compensated]).max() < 1.0  # nothing draws it back: friction alone keeps it slow
    assert np.abs(moved[servoed]).max() < 0.2


def test_torques_of_the_controller_reach_the_goal_that_its_velocities_reach(engine: Engine) -> None:
    model, dt, goal = Model(ROBOT, load_world("table")), 0.02, posture(SIDE, torso_yaw=15.0, torso_pitch=10.0)
    ends = []
    for modality in MODALITIES:
        backend = standing(engine, posture(OUT), dt)
        controller = Controller(model, Gains.default(), modality=modality)
        controller.reset(backend.motors.q)
        controller.attractor = goal
        for _ in range(350):
            command = controller.step(backend.motors.q, dt)
            backend.motors.command(ALL, modality, getattr(command, modality))
            backend.step(dt)
        ends.append(backend.motors.q.copy())
    assert np.abs(ends[0] - ends[1]).max() < np.radians(0.3)
    assert np.abs(ends[1] - goal).max() < np.radians(0.5)


def test_a_torque_bends_a_joint_at_the_speed_that_friction_allows(engine: Engine) -> None:
    backend, elbow = standing(engine, posture(OUT)), ROBOT.motor_index("l_elbow")
    torque = np.zeros(41)
    torque[elbow] = 0.2 * FRICTION
    path = driven(backend, 1.5, torque)
    assert (path[-1, elbow] - path[-51, elbow]) / 0.5 == pytest.approx(0.2, rel=0.05)


def test_neither_a_limit_nor_the_largest_speed_is_passed(engine: Engine) -> None:
    backend, elbow = standing(engine, posture(OUT)), ROBOT.motor_index("l_elbow")
    torque = np.zeros(41)
    torque[elbow] = 40.0
    path = driven(backend, 2.0, torque)
    limit, most = ROBOT.limits[elbow, 1], ROBOT.motor_table[elbow].max_velocity
    assert path[-1, elbow] == pytest.approx(limit, abs=1e-3)
    assert path[:, elbow].max() < limit + 1e-3
    assert np.diff(path[:, elbow]).max() / DT == pytest.approx(most, rel=0.05)


def test_hands_press_the_table_no_harder_than_the_torque_allows(engine: Engine) -> None:
    backend, torso = standing(engine, posture({"elbow": 60.0, "shoulder_pitch": -26.0, "shoulder_roll": 20.0, "wrist_pitch": -1.0})), 2
    torque = np.zeros(41)
    torque[torso] = 8.0
    stiff = backend.motors.q.copy()
    depths = []
    for _ in range(400):
        spring = 60.0 * (stiff - backend.motors.q)
        spring[torso] = 0.0
        driven(backend, DT, torque + spring)
        depths.append(backend.contact().depth)
    assert 0.0 < max(depths) < 0.002
    assert depths[-1] > 0.0
    passed = backend.motors.efforts - gravity_torque(ROBOT, backend.motors.q)
    assert passed[torso] == pytest.approx(8.0, abs=0.1)


def test_wild_torques_leave_it_finite_inside_its_limits_and_repeatable(engine: Engine) -> None:
    def path(backend: Backend) -> Array:
        rng = np.random.default_rng(3)
        return np.concatenate([driven(backend, 0.1, rng.uniform(-40.0, 40.0, 41), compensated=False) for _ in range(20)])

    first, second = path(standing(engine, posture(OUT))), path(standing(engine, posture(OUT)))
    assert np.isfinite(first).all()
    assert (first > ROBOT.limits[:, 0] - 2e-3).all() and (first < ROBOT.limits[:, 1] + 2e-3).all()
    assert (first == second).all()


def test_a_hold_after_torques_catches_the_arm(engine: Engine) -> None:
    backend = standing(engine, posture(OUT))
    driven(backend, 0.3, compensated=False)
    backend.motors.command(ALL, "hold")
    for _ in range(30):
        backend.step(DT)
    before = backend.motors.q.copy()
    for _ in range(100):
        backend.step(DT)
    assert np.abs(backend.motors.q - before).max() < np.radians(0.5)
