# SPDX-License-Identifier: Apache-2.0
"""The behaviour that both physics engines share: the iCub at its table."""

from __future__ import annotations

import numpy as np
import pytest

from mobee import Model
from mobee.model import World, cylinder
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.kinematic import Backend
from tests.services.robot_sim.engines import Engine

ROBOT = load_robot("icub")
DT = 0.01
ALL = slice(0, len(ROBOT.motors))


def body(engine: Engine, parameters: MotorParameters | None = None) -> Backend:
    return engine(ROBOT, lambda: load_world("table"), parameters or MotorParameters(), seed=0, dt=DT)


def run(backend: Backend, ticks: int) -> float:
    """The deepest contact."""
    deepest = 0.0
    for _ in range(ticks):
        backend.step(DT)
        deepest = max(deepest, backend.contact().depth)
    return deepest


def motor(name: str) -> int:
    return ROBOT.motor_index(name)


def test_a_hold_keeps_the_pose_against_gravity(engine: Engine) -> None:
    backend = body(engine)
    q = ROBOT.home.copy()
    q[[motor("l_shoulder_pitch"), motor("torso_pitch")]] = np.radians([-80.0, 15.0])
    for _ in range(300):
        backend.motors.command(ALL, "position", q)
        backend.step(DT)
    backend.motors.command(ALL, "hold")
    before = backend.motors.q.copy()
    run(backend, 1000)
    assert np.abs(backend.motors.q - before).max() < np.radians(0.2) + 1e-3  # no further than the play


def test_every_motor_follows_a_velocity(engine: Engine) -> None:
    backend = body(engine, MotorParameters.ideal())
    before = backend.motors.q.copy()
    middle = ROBOT.limits.mean(axis=1)
    velocity = 0.1 * np.where(before < middle, 1.0, -1.0)
    velocity[motor("torso_pitch")] = 0.0  # the hands would come down on the table
    backend.motors.command(ALL, "velocity", velocity)
    run(backend, 50)
    moved = backend.motors.q - before
    assert moved == pytest.approx(0.05 * np.sign(velocity), abs=0.002)


def test_only_mujoco_moves_what_is_movable_and_the_other_says_so(engine: Engine) -> None:
    def world() -> World:
        world = World()
        world.add("cup", cylinder(0.03, 0.1), position=(-0.4, 0.0, 0.5), mass=0.1)
        return world

    body = engine(ROBOT, world, MotorParameters(), 0, DT)
    for _ in range(10):
        body.step(DT)
    falls = body.world.objects["cup"].position[2] < 0.49
    assert falls == (body.name == "mujoco")
    assert falls != any("do not move here when they are pushed (cup)" in note for note in body.notes)


def test_a_limit_is_not_passed(engine: Engine) -> None:
    backend = body(engine)
    velocity = np.zeros(len(ROBOT.motors))
    velocity[motor("l_elbow")] = 1.0
    backend.motors.command(ALL, "velocity", velocity)
    run(backend, 200)
    assert backend.motors.q[motor("l_elbow")] == pytest.approx(ROBOT.limits[motor("l_elbow"), 1], abs=1e-3)


def test_a_hand_driven_down_touches_the_table_and_is_stopped_by_it(engine: Engine) -> None:
    backend = body(engine)
    assert run(backend, 10) == 0.0
    assert backend.gap() == pytest.approx(0.08, abs=0.02)
    velocity = np.zeros(len(ROBOT.motors))
    velocity[motor("torso_pitch")] = 0.4
    backend.motors.command(ALL, "velocity", velocity)
    assert 0.0 < run(backend, 300) < 0.01
    assert backend.contact().pair.split("_")[1].startswith("hand") and backend.contact().pair.endswith(" table")
    assert backend.gap() == 0.0
    assert backend.motors.q[motor("torso_pitch")] < np.radians(30.0)  # 69 degrees without a table
    assert np.abs(backend.motors.efforts).max() <= 40.0


def test_a_placed_object_blocks_the_hand_but_is_no_solid_contact(engine: Engine) -> None:
    backend, free = body(engine), body(engine)
    palm = Model(ROBOT).evaluate(ROBOT.home).position("left_palm")
    backend.place("ball", (float(palm[0]), float(palm[1]), float(palm[2]) - 0.06))
    assert backend.world.objects["ball"].position[0] == palm[0]
    velocity = np.zeros(len(ROBOT.motors))
    velocity[motor("l_elbow")] = -0.3
    for each in (backend, free):
        each.motors.command(ALL, "velocity", velocity)
        run(each, 100)
    assert backend.contact().depth == 0.0
    assert np.abs(backend.motors.q - free.motors.q).max() > 0.01


def test_the_same_seed_gives_the_same_motion_also_after_a_reset(engine: Engine) -> None:
    def trajectory(backend: Backend) -> list[list[float]]:
        velocity = np.zeros(len(ROBOT.motors))
        velocity[[motor("torso_pitch"), motor("l_elbow")]] = 0.4, 0.2
        backend.motors.command(ALL, "velocity", velocity)
        found = []
        for _ in range(150):
            backend.step(DT)
            found.append(backend.motors.encoders(1, DT).tolist())
        return found

    first, second = body(engine), body(engine)
    expected = trajectory(first)
    assert trajectory(second) == expected
    second.reset(0)
    assert trajectory(second) == expected
