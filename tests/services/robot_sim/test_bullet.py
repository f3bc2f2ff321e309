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


def test_palms_are_where_the_model_says(rng: np.random.Generator) -> None:
    scene, model = BulletScene(ROBOT, load_world("table"), 0.005), Model(ROBOT)
    for _ in range(200):
        q = rng.uniform(ROBOT.limits[:, 0], ROBOT.limits[:, 1])
        scene.set_posture(q)
        pose = model.evaluate(q)
        for side in ("left", "right"):
            state = scene.client.getLinkState(scene.body, scene.links[f"{side[0]}_hand_dh_frame"], computeForwardKinematics=1)
            assert np.abs(np.array(state[4]) - pose.position(f"{side}_palm")).max() < 1e-3


def test_the_committed_list_agrees_with_the_script_on_fewer_poses() -> None:
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
    assert BulletBackend(ROBOT, lambda: load_world("table"), MotorParameters(), seed=0, dt=0.01).pairs_watched == len(links) + len(table)


def test_the_error_for_another_robot_names_mujoco() -> None:
    with pytest.raises(BackendUnavailable, match='backend = "mujoco"'):
        make_backend(Config(robot="icub_2014", backend="pybullet"), load_robot("icub_2014"))
