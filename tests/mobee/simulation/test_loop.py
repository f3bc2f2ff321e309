# SPDX-License-Identifier: Apache-2.0
"""The compiled loop against the same parts put together in Python, and against itself cut into other pieces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.control import Controller, Gains
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation import MotorParameters, Motors, OfflinePlant

ICUB = load_robot("icub")
PRESS = {"torso": (0.5, 0.5, 0.9), "left_arm": (0.6, 0.3, 0.5, 0.4), "right_arm": (0.5, 0.2, 0.5, 0.5)}  # shares of the ranges
BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)


def pressing(plant: OfflinePlant | Controller) -> None:
    """All parts towards a posture with the hands in the table."""
    for part, shares in PRESS.items():
        low, high = ICUB.limits[ICUB.parts[part].slice].T
        share = np.full(len(low), 0.5)
        share[: len(shares)] = shares
        target = low + share * (high - low)
        plant.set_attractor(part, target) if isinstance(plant, Controller) else plant.begin(part, target)


def in_python(ticks: int, age: int, gains: Gains, modality: str, propagate: str, seed: int, dt: float) -> tuple[Array, Array]:
    """Encoders and joint sides at every tick, each (ticks, n)."""
    model = Model(ICUB, load_world("table"))
    controller = Controller(model, gains, modality, propagate)
    motors = Motors(ICUB, MotorParameters(), seed, ICUB.home)
    track, commands = model.track(), []
    pressing(controller)
    encoders, joints = [], []
    substeps = motors.parameters.substeps(dt)
    for k in range(1, ticks + 1):
        if k > age:
            motors.command(slice(None), modality, getattr(commands[k - age - 1], modality))
        q = motors.encoders(k, dt)
        commands.append(controller.step(q, dt, controller.forces(track.evaluate(q))))
        motors.move(substeps, dt / substeps)
        encoders.append(q)
        joints.append(motors.q)
    return np.array(encoders), np.array(joints)


@BOTH
@pytest.mark.parametrize(("modality", "propagate", "age"), [("velocity", "tree", 1), ("velocity", "part", 1), ("position", "tree", 3)])
def test_the_loop_is_its_parts_put_together_to_the_last_bit(gains: Gains, modality: Any, propagate: Any, age: int) -> None:
    model = Model(ICUB, load_world("table"))
    plant = OfflinePlant(model, 5, gains, dt=0.02, modality=modality, propagate=propagate, command_age=age)
    pressing(plant)
    trace = plant.run(150)
    encoders, joints = in_python(150, age, gains, modality, propagate, 5, 0.02)
    assert trace.field.max() > 0.0
    assert np.array_equal(trace.encoders, encoders)
    assert np.array_equal(trace.q, joints)


@BOTH
def test_tick_by_tick_is_the_same_as_at_once(gains: Gains) -> None:
    def plant() -> OfflinePlant:
        made = OfflinePlant(Model(ICUB, load_world("table")), 3, gains, dt=0.02, hashed=True)
        pressing(made)
        return made

    one, other = plant(), plant()
    for _ in range(120):
        one.tick()
    trace = other.run(120)
    assert np.array_equal(one.motors.q, trace.q[-1])
    assert one.hash == other.hash
    assert [(name, outcome.q.tolist()) for name, outcome in one.advance()] == [
        (name, outcome.q.tolist()) for name, outcome in other.advance()
    ]
    assert one.time == other.time and one.hash == other.hash


def test_the_hash_is_of_seed_and_path() -> None:
    def hashed(seed: int, goal: float) -> str:
        plant = OfflinePlant(Model(ICUB), seed, active=["torso"], hashed=True)
        plant.act("torso", np.array([0.0, 0.0, goal]))
        return plant.hash

    assert hashed(1, 0.3) == hashed(1, 0.3)
    assert len({hashed(1, 0.3), hashed(2, 0.3), hashed(1, 0.31)}) == 3


def test_the_deepest_contacts_of_a_trace_are_those_of_its_poses() -> None:
    model = Model(ICUB, load_world("table"))
    plant = OfflinePlant(model, 3, Gains.published_2014(), dt=0.02)
    pressing(plant)
    trace = plant.run(100)
    for q, solid, field in zip(trace.encoders[::10], trace.solid[::10], trace.field[::10], strict=True):
        depths = {"solid": [0.0], "field": [0.0]}
        for contact in model.evaluate(q).contacts:
            depths[contact.kind].append(contact.depth)
        assert [solid, field] == pytest.approx([max(depths["solid"]), max(depths["field"])], abs=1e-15)


def test_pushes_and_forces_of_a_client_act_as_with_the_controller_alone() -> None:
    plant = OfflinePlant(Model(ICUB), 0, motors=MotorParameters.ideal())
    force = np.zeros(len(ICUB.motors))
    force[ICUB.motor_index("neck_yaw")] = 3.0
    plant.controller.force(force)
    plant.controller.push("left_palm", np.array([0.0, 0.0, 4.0]))
    trace = plant.run(3)
    model = Model(ICUB)
    alone = Controller(model)
    alone.force(force)
    alone.push("left_palm", np.array([0.0, 0.0, 4.0]))
    assert np.array_equal(trace.velocity, [alone.step(q, plant.dt).velocity for q in trace.encoders])
    assert trace.velocity[-1][ICUB.motor_index("neck_yaw")] > 0.0
    plant.controller.clear()
    assert np.abs(plant.run(400).velocity[-1]).max() < 1e-3


def test_the_forces_of_the_last_tick_can_be_read() -> None:
    model = Model(ICUB, load_world("table"))
    plant = OfflinePlant(model, 3, dt=0.02)
    pressing(plant)
    trace = plant.run(80)
    expected = plant.controller.forces(model.evaluate(trace.encoders[-1]))
    assert np.array_equal(plant.controller.last_forces.total, expected.total)
    assert expected.collision.any()


def test_a_late_command_moves_nothing_before_its_time() -> None:
    plant = OfflinePlant(Model(ICUB), 0, motors=MotorParameters.ideal(), command_age=4)
    plant.begin("torso", np.array([0.0, 0.0, 0.4]))
    moved = np.abs(plant.run(8).q - ICUB.home).max(axis=1) > 0.0
    assert moved.tolist() == [False] * 4 + [True] * 4


@pytest.mark.parametrize(("gains", "modality"), [(Gains.default(), "velocity"), (Gains.published_2014(), "position"), (None, "torque")])
def test_a_plant_that_starts_again_is_a_new_one_to_the_last_bit(gains: Gains | None, modality: Any) -> None:
    def plant(seed: int) -> OfflinePlant:
        return OfflinePlant(Model(ICUB, load_world("table")), seed, gains, dt=0.02, modality=modality, hashed=True, command_age=2)

    def pressed(plant: OfflinePlant) -> tuple[str, float]:
        pressing(plant)
        plant.run(60)
        return plant.hash, plant.time

    used, new = plant(3), plant(5)
    pressed(used)
    used.controller.push("left_palm", np.array([5.0, 0.0, 0.0]))
    used.restart(5)
    assert used.acting == () and np.array_equal(used.q, ICUB.home)
    assert pressed(used) == pressed(new)


def test_a_plant_starts_again_at_a_pose_and_only_with_motors_that_are_active() -> None:
    plant = OfflinePlant(Model(ICUB), dt=0.02, active=["left_arm"])
    start = ICUB.home.copy()
    start[ICUB.motor_index("l_wrist_prosup")] += 0.3
    plant.restart(0, start)
    assert np.abs(plant.run(1).encoders[0] - start).max() < 0.02
    for wrong, message in ((start[:3], "a position for every motor"), (ICUB.home + 0.1, "not active"), (ICUB.home + 9.0, "must be")):
        with pytest.raises(InvalidValue, match=message):
            plant.restart(0, wrong)
    with pytest.raises(InvalidValue, match="seed -1"):
        plant.restart(-1)
