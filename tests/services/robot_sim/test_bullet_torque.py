# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee import Controller, Gains, Model
from mobee.arrays import Array
from mobee.control.law import FRICTION, INERTIA, Modality
from mobee.model.masses import gravity_torque
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.bullet_torque import Gears, Motion

H, DT = 0.005, 0.01  # s
FREE = (np.full(3, -np.inf), np.full(3, np.inf))
ROBOT = load_robot("icub")
ALL = slice(None)
MODALITIES: tuple[Modality, ...] = ("velocity", "torque")


def arm(seed: int) -> Motion:
    """Three joints somewhere, the last one as light as a wrist."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * np.array([[1.0], [0.3], [0.05]])
    return Motion(root @ root.T + 0.02 * np.eye(3), rng.normal(size=3), rng.normal(size=3))


def after(now: Motion, torque: Array, held: Array) -> Array:
    """Where an engine without gears takes the joints: `held` ones at 0 rad/s, the others by their torque."""
    velocity = np.zeros(3)
    at, rest = np.flatnonzero(~held), np.flatnonzero(held)
    push = H * (torque - now.bias)[at] - now.mass[np.ix_(at, rest)] @ -now.velocity[rest]
    velocity[at] = now.velocity[at] + np.linalg.solve(now.mass[np.ix_(at, at)], push)
    return velocity


@given(st.integers(0, 2**32 - 1), st.lists(st.booleans(), min_size=3, max_size=3))
def test_arm_rotor_and_friction_move_as_one(seed: int, held: list[bool]) -> None:
    now, torque, stopped = arm(seed), np.random.default_rng(seed).normal(size=3), np.array(held)
    share = Gears(3).transmit(now, torque, ~stopped, np.zeros(3), FREE, False, H)
    then = after(now, share.torque, stopped)
    change = (then - now.velocity) / H
    together = now.mass @ change + INERTIA * change + FRICTION * then + now.bias - torque
    np.testing.assert_allclose(together[~stopped], 0.0, atol=1e-8)
    assert not share.torque[stopped].any() and (share.free == ~stopped).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_blocked_joint_is_pressed_with_the_whole_torque_in_the_end(seed: int) -> None:
    still = Motion(arm(seed).mass, arm(seed).bias, np.zeros(3))
    gears, torque = Gears(3), np.array([5.0, -3.0, 1.0])
    for _ in range(600):
        share = gears.transmit(still, torque, np.ones(3, dtype=bool), np.zeros(3), FREE, True, H)
    np.testing.assert_allclose(share.torque, torque, atol=1e-5)


def test_a_joint_stops_at_the_end_of_its_range_and_the_others_feel_it() -> None:
    now, torque = replace(arm(1), velocity=np.zeros(3)), np.array([30.0, 0.0, 0.0])
    fastest = (np.full(3, -np.inf), np.array([0.0, np.inf, np.inf]))
    share = Gears(3).transmit(now, torque, np.ones(3, dtype=bool), np.zeros(3), fastest, False, H)
    assert share.free.tolist() == [False, True, True]
    assert share.velocity[0] == 0.0
    alone = Gears(3).transmit(now, torque, share.free, np.zeros(3), FREE, False, H)
    np.testing.assert_allclose(share.torque, alone.torque)


def test_what_acted_from_outside_is_forgotten_without_contact_and_on_demand() -> None:
    now, free, torque = arm(2), np.ones(3, dtype=bool), np.array([5.0, 0.0, 0.0])
    fresh = Gears(3).transmit(now, torque, free, np.zeros(3), FREE, True, H)
    gears = Gears(3)
    gears.transmit(arm(3), torque, free, np.zeros(3), FREE, True, H)
    assert not np.allclose(gears.transmit(now, torque, free, np.zeros(3), FREE, True, H).torque, fresh.torque)
    assert (gears.transmit(now, torque, free, np.zeros(3), FREE, False, H).torque == fresh.torque).all()
    gears.forget()
    assert (gears.transmit(now, torque, free, np.zeros(3), FREE, True, H).torque == fresh.torque).all()


pytest.importorskip("pybullet")
from services.robot_sim.bullet import BulletBackend  # noqa: E402  # only where PyBullet is

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


def standing(q: Array, dt: float = DT) -> BulletBackend:
    """The robot at rest at q."""
    motors = tuple(replace(motor, home=float(at)) for motor, at in zip(ROBOT.motor_table, q, strict=True))
    robot = replace(ROBOT, motor_table=motors)
    backend = BulletBackend(robot, lambda: load_world("table"), MotorParameters(encoder_noise=0.0), seed=0, dt=dt)
    for _ in range(10):
        backend.step(dt)
    return backend


def driven(backend: BulletBackend, seconds: float, torque: Array | None = None, compensated: bool = True) -> Array:
    """The way (ticks, n) of a robot that gets `torque` and what its weight needs."""
    way = []
    for _ in range(round(seconds / DT)):
        weight = gravity_torque(ROBOT, backend.motors.q) if compensated else np.zeros(41)
        backend.motors.command(ALL, "torque", weight + (0.0 if torque is None else torque))
        backend.step(DT)
        way.append(backend.motors.q.copy())
    return np.array(way)


@pytest.mark.parametrize("dt", [0.005, 0.02])
def test_an_arm_held_out_stays_with_compensation_and_the_other_sags_without(dt: float) -> None:
    backend = standing(posture(OUT, torso_pitch=15.0), dt)
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


def test_torques_of_the_controller_reach_the_goal_that_its_velocities_reach() -> None:
    model, dt, goal = Model(ROBOT, load_world("table")), 0.02, posture(SIDE, torso_yaw=15.0, torso_pitch=10.0)
    ends = []
    for modality in MODALITIES:
        backend = standing(posture(OUT), dt)
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


def test_a_torque_bends_a_joint_at_the_speed_that_friction_allows() -> None:
    backend, elbow = standing(posture(OUT)), ROBOT.motor_index("l_elbow")
    torque = np.zeros(41)
    torque[elbow] = 0.2 * FRICTION
    way = driven(backend, 1.5, torque)
    assert (way[-1, elbow] - way[-51, elbow]) / 0.5 == pytest.approx(0.2, rel=0.05)


def test_neither_a_limit_nor_the_largest_speed_is_passed() -> None:
    backend, elbow = standing(posture(OUT)), ROBOT.motor_index("l_elbow")
    torque = np.zeros(41)
    torque[elbow] = 40.0
    way = driven(backend, 2.0, torque)
    limit, most = ROBOT.limits[elbow, 1], ROBOT.motor_table[elbow].max_velocity
    assert way[-1, elbow] == pytest.approx(limit, abs=1e-3)
    assert way[:, elbow].max() < limit + 1e-3
    assert np.diff(way[:, elbow]).max() / DT == pytest.approx(most, rel=0.05)


def test_hands_press_the_table_no_harder_than_the_torque_and_give_way() -> None:
    backend, torso = standing(posture({"elbow": 60.0, "shoulder_pitch": -26.0, "shoulder_roll": 20.0, "wrist_pitch": -1.0})), 2
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


def test_wild_torques_leave_it_finite_inside_its_limits_and_repeatable() -> None:
    def way(backend: BulletBackend) -> Array:
        rng = np.random.default_rng(3)
        return np.concatenate([driven(backend, 0.1, rng.uniform(-40.0, 40.0, 41), compensated=False) for _ in range(20)])

    first, second = way(standing(posture(OUT))), way(standing(posture(OUT)))
    assert np.isfinite(first).all()
    assert (first > ROBOT.limits[:, 0] - 2e-3).all() and (first < ROBOT.limits[:, 1] + 2e-3).all()
    assert (first == second).all()


def test_a_hold_after_torques_catches_the_arm() -> None:
    backend = standing(posture(OUT))
    driven(backend, 0.3, compensated=False)
    backend.motors.command(ALL, "hold")
    for _ in range(30):
        backend.step(DT)
    before = backend.motors.q.copy()
    for _ in range(100):
        backend.step(DT)
    assert np.abs(backend.motors.q - before).max() < np.radians(0.5)
