# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee import Model
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.bullet_scene import load_solid_pairs
from services.robot_sim.config import Config
from services.robot_sim.kinematic import BackendUnavailable
from services.robot_sim.make import make_backend

pytest.importorskip("pybullet")
from services.robot_sim.bullet import BulletBackend  # noqa: E402  # only where PyBullet is
from services.robot_sim.bullet_scene import BulletScene  # noqa: E402  # only where PyBullet is

ROBOT = load_robot("icub")
DT = 0.01
ALL = slice(0, len(ROBOT.motors))
FIVE_CM = 0.05


def body(parameters: MotorParameters | None = None) -> BulletBackend:
    return BulletBackend(ROBOT, lambda: load_world("table"), parameters or MotorParameters(), seed=0, dt=DT)


def run(backend: BulletBackend, ticks: int) -> float:
    """The deepest contact."""
    deepest = 0.0
    for _ in range(ticks):
        backend.step(DT)
        deepest = max(deepest, backend.contact().depth)
    return deepest


def motor(name: str) -> int:
    return ROBOT.motor_index(name)


def test_palms_are_where_the_model_says(rng: np.random.Generator) -> None:
    scene, model = BulletScene(ROBOT, load_world("table"), 0.005), Model(ROBOT)
    for _ in range(200):
        q = rng.uniform(ROBOT.limits[:, 0], ROBOT.limits[:, 1])
        scene.set_posture(q)
        pose = model.evaluate(q)
        for side in ("left", "right"):
            state = scene.client.getLinkState(scene.body, scene.links[f"{side[0]}_hand_dh_frame"], computeForwardKinematics=1)
            assert np.abs(np.array(state[4]) - pose.position(f"{side}_palm")).max() < 1e-3


def test_a_hold_keeps_the_pose_against_gravity() -> None:
    backend = body()
    q = ROBOT.home.copy()
    q[[motor("l_shoulder_pitch"), motor("torso_pitch")]] = np.radians([-80.0, 15.0])
    for _ in range(300):
        backend.motors.command(ALL, "position", q)
        backend.step(DT)
    backend.motors.command(ALL, "hold")
    before = backend.motors.q.copy()
    run(backend, 1000)
    assert np.abs(backend.motors.q - before).max() < np.radians(0.2) + 1e-3  # no further than the play


def test_every_motor_follows_a_velocity() -> None:
    backend = body(MotorParameters.ideal())
    before = backend.motors.q.copy()
    middle = ROBOT.limits.mean(axis=1)
    velocity = 0.1 * np.where(before < middle, 1.0, -1.0)
    velocity[motor("torso_pitch")] = 0.0  # the hands would come down on the table
    backend.motors.command(ALL, "velocity", velocity)
    run(backend, 50)
    moved = backend.motors.q - before
    assert moved == pytest.approx(0.05 * np.sign(velocity), abs=0.002)


def test_a_limit_is_not_passed() -> None:
    backend = body()
    velocity = np.zeros(len(ROBOT.motors))
    velocity[motor("l_elbow")] = 1.0
    backend.motors.command(ALL, "velocity", velocity)
    run(backend, 200)
    assert backend.motors.q[motor("l_elbow")] == pytest.approx(ROBOT.limits[motor("l_elbow"), 1], abs=1e-3)


def test_a_hand_driven_down_touches_the_table_and_is_stopped_by_it() -> None:
    backend = body()
    assert run(backend, 10) == 0.0
    assert backend.gap() == pytest.approx(0.08, abs=0.02)
    velocity = np.zeros(len(ROBOT.motors))
    velocity[motor("torso_pitch")] = 0.4
    backend.motors.command(ALL, "velocity", velocity)
    assert 0.0 < run(backend, 300) < 0.01
    assert backend.contact().pair in ("l_hand table", "r_hand table")
    assert backend.gap() == 0.0
    assert backend.motors.q[motor("torso_pitch")] < np.radians(30.0)  # 69 degrees without a table
    assert np.abs(backend.motors.efforts).max() <= 40.0


def test_an_object_is_placed_and_the_hand_feels_it_but_it_is_no_solid_contact() -> None:
    backend, free = body(), body()
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


def test_the_same_seed_gives_the_same_motion_also_after_a_reset() -> None:
    def trajectory(backend: BulletBackend) -> list[list[float]]:
        velocity = np.zeros(len(ROBOT.motors))
        velocity[[motor("torso_pitch"), motor("l_elbow")]] = 0.4, 0.2
        backend.motors.command(ALL, "velocity", velocity)
        found = []
        for _ in range(150):
            backend.step(DT)
            found.append(backend.motors.encoders(1, DT).tolist())
        return found

    first, second = body(), body()
    expected = trajectory(first)
    assert trajectory(second) == expected
    second.reset(0)
    assert trajectory(second) == expected


def test_the_committed_list_is_what_the_script_finds_on_fewer_poses() -> None:
    from experiments.robots import solid_pairs

    listed, scene = load_solid_pairs(), BulletScene(ROBOT, load_world("table"), 0.005)
    assert listed.always == solid_pairs.always()
    poses = solid_pairs.legal_poses(ROBOT, np.random.default_rng(listed.seed), 200)  # the first of those 2000
    assert solid_pairs.stay_apart(scene, listed.apart, poses) == listed.apart
    assert not solid_pairs.stay_apart(scene, [["chest", "l_shoulder_1"], ["l_forearm", "l_hand"]], poses)


def test_hands_and_forearms_are_watched_against_body_other_arm_and_table() -> None:
    listed = load_solid_pairs()
    links, table = listed.links(), listed.against_table()
    for link in ("l_hand", "l_forearm", "r_hand", "r_forearm"):
        other = "r" if link[0] == "l" else "l"
        assert link in table
        for against in ("chest", "head", "root_link", f"{other}_hand", f"{other}_upper_arm"):
            assert frozenset((link, against)) in links
    assert body().pairs_watched == len(links) + len(table)


def test_a_robot_that_the_urdf_does_not_describe_is_told_to_take_the_kinematic_back_end() -> None:
    with pytest.raises(BackendUnavailable, match='backend = "kinematic"'):
        make_backend(Config(robot="icub_2014"), load_robot("icub_2014"))
