# SPDX-License-Identifier: Apache-2.0
"""The shipped iCub against its sources."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.icub_urdf import write_upper_body_urdf
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from tests.mobee.robot.poses import marker_frame, motor_vector, reference_poses, satisfied

YARP_ARM = (
    "shoulder_pitch shoulder_roll shoulder_yaw elbow wrist_prosup wrist_pitch wrist_yaw hand_finger thumb_oppose thumb_proximal "
    "thumb_distal index_proximal index_distal middle_proximal middle_distal pinky"
).split()
# the thesis' 4^4 lattice of an arm, 20/40/60/80 %, index pitch + 4 roll + 16 yaw + 64 elbow: the states that break a cable row
VIOLATING = [44, 45, 56, 60, 61, 62, 108, 109, 120, 124, 125, 126, 172, 173, 184, 188, 189, 190, 236, 237, 248, 252, 253, 254]


@pytest.fixture(scope="module")
def icub() -> Robot:
    return load_robot("icub")


def test_41_motors_stand_in_the_order_of_the_yarp_axes(icub: Robot) -> None:
    assert list(icub.parts) == ["torso", "head", "left_arm", "right_arm"]
    assert icub.parts["torso"].motors == ("torso_yaw", "torso_roll", "torso_pitch")
    assert icub.parts["head"].motors == ("neck_pitch", "neck_roll", "neck_yaw", "eyes_tilt", "eyes_version", "eyes_vergence")
    assert icub.parts["left_arm"].motors == tuple(f"l_{name}" for name in YARP_ARM)
    assert icub.parts["right_arm"].motors == tuple(f"r_{name}" for name in YARP_ARM)
    assert len(icub.motors) == 41


def test_limits_are_the_narrower_of_urdf_and_simulator(icub: Robot) -> None:
    expected = {"torso_pitch": (-10, 70), "neck_pitch": (-40, 22), "l_shoulder_pitch": (-95, 10), "l_shoulder_roll": (0, 160.8)}
    expected |= {"r_elbow": (15.5, 106), "r_wrist_prosup": (-60, 60), "l_wrist_pitch": (-80, 0), "l_pinky": (0, 270)}
    for motor, limits in expected.items():
        np.testing.assert_allclose(np.rad2deg(icub.limits[icub.motor_index(motor)]), limits, atol=1e-9)


def test_home_is_inside_the_limits_and_the_constraints(icub: Robot) -> None:
    assert np.all(icub.limits[:, 0] <= icub.home) and np.all(icub.home <= icub.limits[:, 1])
    assert satisfied(icub, icub.home)


@pytest.mark.parametrize("marker", ["left_palm", "right_palm", "head"])
def test_markers_stand_where_icub_models_puts_them(icub: Robot, marker: str) -> None:
    for pose in reference_poses("icub_poses.json"):
        position, rotation, _ = marker_frame(icub, marker, motor_vector(icub, pose["q_deg"]))
        np.testing.assert_allclose(position, pose[marker]["p"], atol=1e-5)
        np.testing.assert_allclose(rotation, pose[marker]["R"], atol=1e-5)


def test_palms_face_the_body_at_zero_pose(icub: Robot) -> None:
    np.testing.assert_allclose(icub.markers["left_palm"].normal, [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(icub.markers["right_palm"].normal, [0, -1, 0], atol=1e-9)
    np.testing.assert_allclose(icub.markers["left_palm"].rotation[:, 2], [0, -1, 0], atol=1e-9)
    np.testing.assert_allclose(icub.markers["right_palm"].rotation[:, 2], [0, -1, 0], atol=1e-9)


def test_vergence_turns_both_eyes_inwards_and_version_turns_them_alike(icub: Robot) -> None:
    version, vergence = np.deg2rad([10.0, 30.0])
    q = np.zeros(41)
    q[icub.motor_index("eyes_version")], q[icub.motor_index("eyes_vergence")] = version, vergence
    for eye, pan in (("left_eye", version + vergence / 2), ("right_eye", version - vergence / 2)):
        _, _, normal = marker_frame(icub, eye, q)
        np.testing.assert_allclose(normal, [-np.cos(pan), np.sin(pan), 0], atol=1e-9)  # +y is the robot's right


def test_finger_motors_close_every_joint_they_drive(icub: Robot) -> None:
    matrix, offset = icub.coupling
    angles = np.rad2deg(matrix @ icub.limits[:, 1] + offset)
    closed = dict(zip((joint.name for joint in icub.joints), angles, strict=True))
    for finger in ("thumb_2", "thumb_3", "index_2", "index_3", "middle_2", "ring_1", "ring_3", "little_1", "little_3"):
        assert closed[f"l_hand_{finger}"] == pytest.approx(90)
    for finger in ("index_0", "ring_0", "little_0"):  # 0 spreads the fingers, 60 closes them
        assert closed[f"r_hand_{finger}"] == pytest.approx(0)


def test_palms_agree_with_the_simulators_own_link_states(icub: Robot, tmp_path: Path, rng: np.random.Generator) -> None:
    pybullet = pytest.importorskip("pybullet", reason="PyBullet has no wheel for this Python")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(str(write_upper_body_urdf(tmp_path / "icub.urdf")), useFixedBase=True, physicsClientId=client)
        info = [pybullet.getJointInfo(body, k, physicsClientId=client) for k in range(pybullet.getNumJoints(body, physicsClientId=client))]
        joints = {entry[1].decode(): entry[0] for entry in info if entry[2] == pybullet.JOINT_REVOLUTE}
        links = {entry[12].decode(): entry[0] for entry in info}
        for q in rng.uniform(*icub.limits.T, (200, 41)):
            for name, joint in joints.items():
                pybullet.resetJointState(body, joint, q[icub.motor_index(name)], physicsClientId=client)
            for marker, link in (("left_palm", "l_hand_dh_frame"), ("right_palm", "r_hand_dh_frame")):
                state = pybullet.getLinkState(body, links[link], computeForwardKinematics=True, physicsClientId=client)
                position, rotation, _ = marker_frame(icub, marker, q)
                np.testing.assert_allclose(position, state[4], atol=1e-3)
                np.testing.assert_allclose(rotation.ravel(), pybullet.getMatrixFromQuaternion(state[5]), atol=1e-3)
    finally:
        pybullet.disconnect(client)


def test_cable_rows_leave_the_published_share_of_the_shoulder_box(icub: Robot) -> None:
    box = np.deg2rad([[-96, 10], [0, 161], [-37, 80]])  # the limits of the 2014 file
    middles = (np.arange(80) + 0.5) / 80
    q = np.zeros((80**3, 41))
    arm = icub.parts["left_arm"]
    q[:, arm.start : arm.start + 3] = _grid(box, middles)
    rows = [clause for clause in icub.clauses if clause.part == "left_arm" and len(clause.b) == 1]
    assert len(rows) == 5
    feasible = np.all([q @ row.a[0] + row.b[0] > 0 for row in rows], axis=0)
    assert feasible.mean() == pytest.approx(0.8232, abs=1e-3)


def _grid(box: Array, fractions: Array) -> Array:
    axes = [low + (high - low) * fractions for low, high in box]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(box))


@pytest.mark.parametrize("part", ["left_arm", "right_arm"])
def test_the_thesis_lattice_breaks_the_cable_rows_in_the_published_states(icub: Robot, part: str) -> None:
    start = icub.parts[part].start
    low, high = icub.limits[start : start + 4].T
    violating = []
    for elbow, yaw, roll, pitch in itertools.product(range(4), repeat=4):
        q = icub.home.copy()
        q[start : start + 4] = low + (high - low) * (0.2 + 0.2 * np.array([pitch, roll, yaw, elbow]))
        if not satisfied(icub, q):
            violating.append(pitch + 4 * roll + 16 * yaw + 64 * elbow)
    assert violating == VIOLATING


def test_forearm_clauses_forbid_turning_a_bent_elbow_only(icub: Robot) -> None:
    q = icub.home.copy()
    for elbow, prosup, allowed in ((95, 50, False), (95, -50, False), (95, 40, True), (85, 55, True), (85, -55, True)):
        q[icub.motor_index("l_elbow")], q[icub.motor_index("l_wrist_prosup")] = np.deg2rad([elbow, prosup])
        assert satisfied(icub, q) is allowed


def test_nothing_touches_at_home(icub: Robot) -> None:
    assert Model(icub).evaluate(icub.home).contacts == ()


def test_no_pair_is_in_contact_all_the_time(icub: Robot, rng: np.random.Generator) -> None:
    model = Model(icub)
    poses = [q for q in rng.uniform(*icub.limits.T, (300, 41)) if satisfied(icub, q)]
    counts: dict[tuple[str, str], int] = {}
    for q in poses:
        for pair in {(contact.first, contact.second) for contact in model.evaluate(q).contacts}:
            counts[pair] = counts.get(pair, 0) + 1
    assert counts, "the sample shows no contact at all"
    assert max(counts.values()) < 0.5 * len(poses)


@pytest.mark.parametrize("part", ["left_arm", "right_arm"])
def test_few_lattice_states_of_an_arm_touch_the_own_body(icub: Robot, part: str) -> None:
    model, start = Model(icub), icub.parts[part].start
    q = icub.limits.mean(axis=1)
    q[:9] = 0
    other = icub.parts["right_arm" if part == "left_arm" else "left_arm"].slice
    q[other] = icub.home[other]
    low, high = icub.limits[start : start + 4].T
    touching = 0
    for levels in itertools.product((0.25, 0.5, 0.75), repeat=4):
        q[start : start + 4] = low + (high - low) * levels
        touching += bool(model.evaluate(q).contacts)
    assert touching < 0.1 * 81


@pytest.mark.parametrize("role", ["solid", "field"])
def test_hands_and_forearms_are_tested_against_torso_head_and_other_arm(icub: Robot, role: str) -> None:
    pairs = icub.solid_pairs if role == "solid" else icub.field_pairs
    tested = {frozenset((icub.links[icub.shapes[i].link], icub.links[icub.shapes[j].link])) for i, j in pairs}
    for link in ("hand", "forearm"):
        for other in ("root_link", "torso_1", "torso_2", "chest", "head", "r_hand", "r_forearm", "r_shoulder_3"):
            assert frozenset((f"l_{link}", other)) in tested


def test_the_base_is_spared_by_the_world_and_the_chest_is_not(icub: Robot) -> None:
    assert {icub.links[icub.shapes[k].link] for k in icub.base_shapes} == {"root_link"}


def test_home_is_clear_of_the_table(icub: Robot) -> None:
    assert Model(icub, load_world("table")).evaluate(icub.home).contacts == ()
