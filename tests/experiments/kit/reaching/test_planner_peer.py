# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.reaching.arm import MARKER, PART, Errors, JudgedPlant, arm_belief, arm_plant, body
from experiments.kit.reaching.belief import NEAR, approach, goals
from experiments.kit.reaching.planner_peer import PeerMemory, PlannerPeer
from experiments.kit.reaching.targets import GOOD
from mobee import Model, World, sphere
from mobee.reach import ReachTarget

TARGET = ReachTarget(np.array([-0.3, 0.2, 0.2]), aim="surface")


@pytest.fixture
def belief():
    return arm_belief()


def test_inverse_kinematics_brings_the_palm_to_the_surface(belief):
    rng = np.random.default_rng(0)
    q, missing = approach(belief, rng.uniform(*belief.limits.T, (32, 4)), TARGET.position, TARGET.radius, belief.limits)
    palms = Model(body()).evaluate(belief.whole(q)).position(MARKER)
    assert np.allclose(missing, np.maximum(np.linalg.norm(palms - TARGET.position, axis=1) - TARGET.radius, 0.0))
    assert (missing < 1e-3).sum() > 10
    assert (q >= belief.limits[:, 0]).all() and (q <= belief.limits[:, 1]).all()


def test_goals_touch_with_the_hand_alone_and_the_poses_before_them_with_nothing(belief):
    belief.present(TARGET)
    poses, befores = goals(belief, TARGET, np.random.default_rng(0))
    assert len(poses) == len(befores) > 3
    assert belief.sound(poses, "grasping").all() and belief.sound(befores).all()
    assert all(belief.sound_motion(before, pose, "grasping") for before, pose in zip(befores, poses, strict=True))
    palms = belief.model.evaluate(belief.whole(poses)).position(MARKER)
    assert max(TARGET.missing(palm) for palm in palms) < 3e-3


def test_poses_with_field_contacts_are_not_sound_except_the_hand_at_the_target(belief):
    belief.present(TARGET)
    low, high = belief.range.T
    befores = np.clip(goals(belief, TARGET, np.random.default_rng(0))[1], low, high)
    q = np.concatenate([befores + width * np.random.default_rng(1).normal(size=befores.shape) for width in (0.0, 0.05, 0.1, 0.3)])
    q = np.concatenate([np.clip(q, low, high), np.random.default_rng(2).uniform(low, high, (200, 4))])
    sound, seen = belief.sound(q, "solids"), Model(body(), belief.model.world)
    in_contact = np.bincount(seen.evaluate(belief.whole(q), reaching=MARKER).table.pose, minlength=len(q)) > 0
    hand_alone = sound & ~in_contact & (np.bincount(seen.evaluate(belief.whole(q)).table.pose, minlength=len(q)) > 0)
    assert hand_alone.any() and (sound & in_contact).any()
    assert belief.sound(q, "fields").tolist() == (sound & ~in_contact).tolist()


def test_blocked_poses_are_avoided(belief):
    pose = belief.limits.mean(axis=1)
    assert belief.sound(pose[None])[0]
    belief.blocked = pose[None]
    assert belief.sound(np.array([pose, pose + 0.2 * belief.span])).tolist() == [False, True]


def test_cables_count_only_in_beliefs_that_contain_them():
    rng = np.random.default_rng(0)
    knowing, ignorant = arm_belief(), arm_belief(cables=False)
    poses = rng.uniform(*knowing.limits.T, (500, 4))
    known, unknown = knowing.sound(poses), ignorant.sound(poses)
    assert not (known & ~unknown).any() and (unknown & ~known).any()


class TestPeer:
    @pytest.fixture(autouse=True)
    def ompl(self):
        pytest.importorskip("ompl")

    def make(self, belief, memory="none", world=None, errors=None):
        plant = JudgedPlant(arm_plant(0, world), errors)
        return plant, PlannerPeer(plant, belief, PART, memory, 0)

    def test_with_a_true_model_it_reaches_the_target(self, belief):
        plant, peer = self.make(belief)
        tried = peer.try_problem(TARGET)
        assert tried.ended == "there" and tried.missing <= GOOD and tried.plans >= 1

    def test_it_believes_to_be_there_where_the_model_is_wrong(self, belief):
        off = Errors(np.zeros(len(body().motors)), np.array([-0.1, 0.0, 0.1]))
        tried = self.make(belief, errors=off)[1].try_problem(TARGET)
        assert tried.ended == "there" and tried.missing > GOOD

    @pytest.mark.parametrize("memory", ["none", "blocked"])
    def test_blocked_poses_count_in_the_next_try_only_with_memory(self, memory):
        shell = World()
        for number, direction in enumerate(np.concatenate([np.eye(3), -np.eye(3)])):
            shell.add(f"ball {number}", sphere(0.04), position=TARGET.position + 0.1 * direction)
        plant, peer = self.make(arm_belief(), memory, shell)
        assert peer.try_problem(TARGET).ended != "there"
        for name in shell.objects:
            if name.startswith("ball"):
                shell.remove(name)
        away = ReachTarget(np.array([-0.2, 0.4, 0.2]), aim="surface")
        assert peer.try_problem(away).ended == "there"
        assert (peer.remembered > 0) == (memory == "blocked")


def test_a_judged_plant_returns_the_true_remaining_error():
    turns = np.zeros(len(body().motors))
    turns[body().motor_index("r_elbow")] = 0.1
    plant = JudgedPlant(arm_plant(0), Errors(turns, np.array([0.0, 0.0, 0.02])))
    plant.present(TARGET)
    q = plant.q
    true = Model(body()).evaluate(q + turns).position(MARKER)
    assert plant.missing(MARKER) == pytest.approx(np.linalg.norm(TARGET.position + [0.0, 0.0, 0.02] - true) - TARGET.radius)
    outcome = plant.reach(PART, MARKER)
    q[body().parts[PART].slice] = outcome.q
    assert np.allclose(outcome.marker, Model(body()).evaluate(q + turns).position(MARKER), atol=2e-3)  # the other parts' encoders are noisy
    assert outcome.missing == pytest.approx(max(np.linalg.norm(TARGET.position + [0.0, 0.0, 0.02] - outcome.marker) - TARGET.radius, 0.0))


SPAN = np.array([1.0, 2.0])
HERE, ELSEWHERE = (ReachTarget(np.array(place)) for place in ([-0.3, 0.2, 0.2], [-0.2, 0.4, 0.2]))


def poses(memory, target):
    return [each.tolist() for each in memory.of(target)]


def test_poses_blocked_by_a_target_count_for_this_target_alone():
    memory = PeerMemory(SPAN)
    memory.blocked(np.array([0.02, 0.0]), np.zeros(2), HERE, touched=True)
    memory.blocked(np.array([0.04, 0.0]), np.zeros(2), HERE, touched=False)
    assert poses(memory, HERE) == [[[0.04, 0.0], [0.02, 0.0]], [[0.02, 0.0]]]
    assert poses(memory, ELSEWHERE) == [[[0.04, 0.0]], []] and len(memory) == 2


@pytest.mark.parametrize(("aim", "kept"), [([0.5, 0.0], [NEAR, 0.0]), ([0.0, 0.5], [0.0, 2.0 * NEAR]), ([0.0, 0.1], [0.0, 0.1])])
def test_it_keeps_away_from_where_a_blocked_motion_would_have_gone_next(aim, kept):
    memory = PeerMemory(SPAN)
    memory.blocked(np.array(aim), np.zeros(2), HERE, touched=False)
    assert memory.of(HERE)[0] == pytest.approx(np.array([kept]))


def test_what_is_learned_after_it_was_asked_is_not_in_the_knowledge():
    memory = PeerMemory(SPAN)
    memory.missed(np.ones(2), HERE)
    known = memory.knowledge()
    memory.missed(np.zeros(2), HERE)
    memory.restore(known)
    assert poses(memory, HERE)[0] == [[1.0, 1.0]]
    memory.clear()
    assert len(memory) == 0 and memory.of(HERE)[0].shape == (0, 2)
