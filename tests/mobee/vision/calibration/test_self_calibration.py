# SPDX-License-Identifier: Apache-2.0
"""Offsets of encoders from seen places of the hand: what is found and how certain, changes, errors of the eyes, and the corrected plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.stats import chi2

from mobee import ActionInterrupted, InvalidValue, Lattice, Model, OfflinePlant, ReachTarget, UnknownName
from mobee.arrays import Array
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.plant import Outcome
from mobee.reach import Aim, ReachOutcome
from mobee.robot.load import load_robot
from mobee.vision.calibration.self_calibration import KNOWN, NOISE, JointOffsets, SelfCalibratingPlant

ROBOT = load_robot("icub")
MODEL = Model(ROBOT)
PART, MARKER = "right_arm", "right_palm"
ARM = ("r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow")
WHERE = [ROBOT.motor_index(name) for name in ARM]
SLICE = ROBOT.part(PART).slice
OFFSETS = np.deg2rad([5.0, -4.0, 6.0, -3.0])


def postures(rng: np.random.Generator, number: int) -> Array:
    """Random postures of the arm, true ones."""
    low, high = ROBOT.limits[WHERE].T
    found = np.tile(ROBOT.home, (number, 1))
    found[:, WHERE] = rng.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low), (number, len(WHERE)))
    return found


def observe(filtered: JointOffsets, offsets: ArrayLike, rng: np.random.Generator, number: int) -> None:
    """Let the filter see the hand in random postures of a robot whose encoders are wrong by the offsets."""
    for q in postures(rng, number):
        measured = q.copy()
        measured[WHERE] -= offsets
        filtered.observe(measured, MODEL.evaluate(q).position(MARKER) + rng.normal(0.0, NOISE, 3))


def test_offsets_that_appear_are_detected_at_once_and_found_within_the_reported_covariance() -> None:
    squared = []
    for seed in range(40):
        rng, filtered = np.random.default_rng(seed), JointOffsets(MODEL, MARKER, ARM)
        observe(filtered, np.zeros(4), rng, 20)
        assert filtered.changes == []
        observe(filtered, OFFSETS, rng, 30)
        assert len(filtered.changes) == 1 and filtered.changes[0] <= 25
        error = filtered.offsets - OFFSETS
        assert np.abs(error).max() < np.deg2rad(2.0)
        squared.append(error @ np.linalg.solve(filtered.covariance, error))
    assert chi2.ppf(0.001, 160) < sum(squared) < chi2.ppf(0.999, 160)


def test_if_the_offsets_do_not_change_no_change_is_detected_and_the_estimate_becomes_more_certain() -> None:
    rng, filtered = np.random.default_rng(0), JointOffsets(MODEL, MARKER, ARM)
    observe(filtered, np.zeros(4), rng, 3000)
    assert filtered.changes == [] and filtered.observations == 3000
    assert np.abs(filtered.offsets).max() < 4.0 * np.sqrt(np.diag(filtered.covariance)).max() < np.deg2rad(0.3)


def test_small_offsets_are_those_of_least_squares_with_the_prior() -> None:
    """The oracle: all observations in one linear problem."""
    rng, filtered = np.random.default_rng(3), JointOffsets(MODEL, MARKER, ARM)
    q, seen = postures(rng, 25), []
    for posture in q:
        seen.append(MODEL.evaluate(posture).position(MARKER) + rng.normal(0.0, NOISE, 3))
        filtered.observe(posture, seen[-1])
    jacobians = MODEL.jacobian(q, MARKER)[:, :3, WHERE].reshape(-1, 4)
    residuals = (np.array(seen) - np.array([MODEL.evaluate(one).position(MARKER) for one in q])).ravel()
    information = jacobians.T @ jacobians / NOISE**2 + np.eye(4) / KNOWN**2
    np.testing.assert_allclose(filtered.offsets, np.linalg.solve(information, jacobians.T @ residuals / NOISE**2), atol=2e-5)
    np.testing.assert_allclose(filtered.covariance, np.linalg.inv(information), rtol=0.02, atol=1e-8)


def test_a_single_wrong_place_is_ignored() -> None:
    rng, filtered = np.random.default_rng(1), JointOffsets(MODEL, MARKER, ARM)
    observe(filtered, np.zeros(4), rng, 10)
    before = filtered.offsets.copy(), filtered.covariance.copy()
    assert not filtered.observe(ROBOT.home, MODEL.evaluate(ROBOT.home).position(MARKER) + [0.3, 0.0, 0.0])
    assert (filtered.offsets == before[0]).all() and (filtered.covariance == before[1]).all()
    observe(filtered, np.zeros(4), rng, 10)
    assert filtered.changes == []
    assert filtered.all_offsets[WHERE].tolist() == filtered.offsets.tolist() and np.count_nonzero(filtered.all_offsets) == 4


@pytest.mark.parametrize("error", [0.05, 0.1, 0.3])
def test_two_wrong_places_in_a_row_are_ignored_unless_offsets_explain_both(error: float) -> None:
    for seed in range(20):
        rng, filtered = np.random.default_rng(seed), JointOffsets(MODEL, MARKER, ARM)
        observe(filtered, np.zeros(4), rng, 30)
        for q in postures(rng, 2):
            filtered.observe(q, MODEL.evaluate(q).position(MARKER) + rng.normal(0.0, error, 3))
        assert np.abs(filtered.offsets).max() < np.deg2rad(30.0) and np.isfinite(filtered.covariance).all()
        observe(filtered, np.zeros(4), rng, 30)
        assert np.abs(filtered.offsets).max() < np.deg2rad(3.0)


def test_only_improbable_places_in_a_row_are_a_change() -> None:
    rng, filtered = np.random.default_rng(4), JointOffsets(MODEL, MARKER, ARM)
    observe(filtered, np.zeros(4), rng, 10)
    for _ in range(3):
        observe(filtered, OFFSETS, rng, 1)
        observe(filtered, np.zeros(4), rng, 1)
    assert filtered.changes == []
    observe(filtered, OFFSETS, rng, 2)
    assert filtered.changes == [18]


@pytest.mark.parametrize(
    ("motors", "noise", "error", "words"),
    [
        (["r_knee"], NOISE, UnknownName, "r_knee"),
        (["l_elbow"], NOISE, InvalidValue, "those that move 'right_palm'"),
        ([], NOISE, InvalidValue, "name one or more"),
        (["r_elbow", "r_elbow"], NOISE, InvalidValue, "each motor once"),
        (ARM, 0.0, InvalidValue, "above 0"),
        (ARM, float("nan"), InvalidValue, "above 0"),
    ],
)
def test_wrong_arguments_are_refused(motors: Sequence[str], noise: float, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        JointOffsets(MODEL, MARKER, motors, noise)


@pytest.mark.parametrize("seen", [[0.0, 0.0], [0.0, 0.0, np.nan]])
def test_a_place_without_three_finite_numbers_is_refused(seen: list[float]) -> None:
    filtered = JointOffsets(MODEL, MARKER, ARM)
    with pytest.raises(InvalidValue, match="must be 3 finite numbers"):
        filtered.observe(ROBOT.home, seen)
    assert filtered.observations == 0


def true_place(plant: OfflinePlant, q: Array | None = None) -> Array:
    """Where the hand is, with the encoders at the present values or with those of the arm at q."""
    posture = plant.q
    if q is not None:
        posture[SLICE] = q
    posture[WHERE] += OFFSETS
    return MODEL.evaluate(posture).position(MARKER)


def known_offsets() -> JointOffsets:
    """Right offsets, without any observation."""
    offsets = JointOffsets(MODEL, MARKER, ARM)
    offsets.offsets = OFFSETS.copy()
    return offsets


class Wrong(OfflinePlant):
    """A plant that notes where the hand truly is at the end of a reach, and whose motions may time out."""

    settles = True

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        found = super().reach(part, marker, stay)
        self.end = true_place(self, found.q)
        return found

    def act(self, part: str, target: Array) -> Outcome:
        return replace(super().act(part, target), settled=self.settles)


def test_actions_and_reaches_of_a_corrected_plant_end_where_they_should() -> None:
    rng, plant = np.random.default_rng(2), Wrong(Model(ROBOT), 0, active=ARM)
    corrected = SelfCalibratingPlant(
        plant, JointOffsets(MODEL, MARKER, ARM, noise=0.001), lambda: true_place(plant) + rng.normal(0.0, 0.001, 3)
    )
    home = ROBOT.home[SLICE]
    target = ReachTarget(MODEL.evaluate(ROBOT.home).position(MARKER) + [-0.05, 0.05, 0.05], aim="surface")

    def remaining() -> tuple[float, float]:
        corrected.present(target)
        found = corrected.reach(PART, MARKER)
        corrected.present(None)
        return target.missing(plant.end), found.missing

    wrong, _ = remaining()
    for q in postures(rng, 12):
        corrected.act(PART, q[SLICE])
    assert np.abs(corrected.offsets.offsets - OFFSETS).max() < np.deg2rad(1.0)
    outcome = corrected.act(PART, home)
    assert np.abs(outcome.q - home).max() < np.deg2rad(1.5)  # where an action counts as settled
    assert corrected.measure(PART) == pytest.approx(corrected.q[SLICE])
    assert corrected.q == pytest.approx(plant.q + corrected.offsets.all_offsets)
    assert np.linalg.norm(true_place(plant) - MODEL.evaluate(ROBOT.home).position(MARKER)) < 0.015
    right, believed = remaining()
    assert wrong > 0.02 > 0.008 > right
    assert believed == pytest.approx(right, abs=0.005)


@pytest.mark.parametrize("aim", ["surface", "centre"])
def test_a_corrected_reach_ends_where_that_of_a_robot_with_right_encoders_ends(aim: Aim) -> None:
    right, wrong = OfflinePlant(Model(ROBOT), 0, active=ARM), Wrong(Model(ROBOT), 0, active=ARM)
    corrected = SelfCalibratingPlant(wrong, known_offsets(), lambda: None)
    apart = []
    for q in postures(np.random.default_rng(5), 8):
        target = ReachTarget(np.array([-0.3, 0.2, 0.1]), aim=aim)
        for plant in (right, corrected):
            plant.present(None)
            plant.act(PART, q[SLICE])
            plant.present(target)
        reached = right.reach(PART, MARKER)
        found = corrected.reach(PART, MARKER)
        apart.append(np.linalg.norm(wrong.end - reached.marker))
        assert found.missing == pytest.approx(target.missing(wrong.end), abs=1e-6)
    print(np.round(1e3 * np.array(apart), 1), "mm")
    assert np.median(apart) < 0.01


def test_the_outcome_of_a_reach_that_stays_is_of_one_posture_also_when_offsets_are_found() -> None:
    rng, wrong = np.random.default_rng(6), Wrong(Model(ROBOT), 0, active=ARM)
    corrected = SelfCalibratingPlant(wrong, JointOffsets(MODEL, MARKER, ARM, noise=0.001), lambda: true_place(wrong))
    target = ReachTarget(np.array([-0.3, 0.2, 0.1]))
    for number, q in enumerate(postures(rng, 3)):
        corrected.act(PART, q[SLICE])
        corrected.present(target)
        found = corrected.reach(PART, MARKER, stay=True)
        corrected.present(None)
        assert found.q == pytest.approx(found.after.q, abs=1e-9), number
        assert found.missing == pytest.approx(target.missing(found.marker))
    assert len(corrected.offsets.changes) == 1


def test_after_a_reach_the_plant_has_the_target_that_was_presented_and_nothing_is_seen_of_a_moving_robot() -> None:
    wrong = Wrong(Model(ROBOT), 0, active=ARM)
    corrected = SelfCalibratingPlant(wrong, known_offsets(), lambda: np.full(3, np.nan))
    corrected.present(target := ReachTarget(np.array([-0.3, 0.2, 0.1])))
    corrected.reach(PART, MARKER)
    assert (wrong.model.world.objects["reach_target"].position == target.position).all()
    corrected.act(PART, ROBOT.home[SLICE])
    assert corrected.offsets.observations == 0  # a place of NaN is not seen
    watched = SelfCalibratingPlant(wrong, JointOffsets(MODEL, MARKER, ARM), lambda: true_place(wrong))
    wrong.settles = False
    watched.act(PART, ROBOT.home[SLICE])
    assert watched.offsets.observations == 0
    wrong.settles = True
    watched.act(PART, ROBOT.home[SLICE])
    assert watched.offsets.observations == 1


def test_a_reach_counts_also_if_the_target_cannot_be_put_back() -> None:
    """A live plant interrupts what it does while the model does not answer."""

    class WithoutModel(Wrong):
        presented = 0

        def present(self, target: ReachTarget | None) -> None:
            self.presented += 1
            if self.presented == 3:
                raise ActionInterrupted("the model does not answer")
            super().present(target)

    wrong = WithoutModel(Model(ROBOT), 0, active=ARM)
    corrected = SelfCalibratingPlant(wrong, known_offsets(), lambda: None)
    corrected.present(target := ReachTarget(np.array([-0.3, 0.2, 0.1])))
    assert corrected.reach(PART, MARKER).missing == pytest.approx(target.missing(wrong.end))
    assert wrong.presented == 3


@pytest.mark.parametrize("offsets", [known_offsets, lambda: JointOffsets(MODEL, MARKER, ARM)])
def test_targets_that_a_plant_refuses_are_refused(offsets: Callable[[], JointOffsets]) -> None:
    corrected = SelfCalibratingPlant(OfflinePlant(Model(ROBOT), 0, active=ARM), offsets(), lambda: None)
    for target in (np.array(0.3), np.array([0.3]), np.full(16, 10.0), np.full(16, np.nan)):
        with pytest.raises(InvalidValue):
            corrected.act(PART, target)
    corrected.present(ReachTarget(np.array([-0.3, 0.2, 0.1]), faces=True))
    if corrected.offsets.offsets.any():
        with pytest.raises(InvalidValue, match="is not corrected"):
            corrected.reach(PART, MARKER)


def test_a_target_beyond_an_uncorrected_limit_moves_the_motor_to_the_limit() -> None:
    offsets = JointOffsets(MODEL, MARKER, ARM)
    offsets.offsets = OFFSETS.copy()
    plant = OfflinePlant(Model(ROBOT), 0, active=ARM)
    high = ROBOT.home.copy()
    high[WHERE] = ROBOT.limits[WHERE, 1]
    outcome = SelfCalibratingPlant(plant, offsets, lambda: None).act(PART, high[SLICE])
    assert (plant.q[WHERE] <= ROBOT.limits[WHERE, 1] + 1e-3).all() and np.isfinite(outcome.q).all()


def test_an_agent_on_a_plant_whose_hand_is_never_seen_acts_as_without() -> None:
    steps = []
    for wrapped in (False, True):
        plant = OfflinePlant(Model(ROBOT), 1, active=ARM)
        corrected = SelfCalibratingPlant(plant, JointOffsets(MODEL, MARKER, ARM), lambda: None)
        agent = ReachAgent(Lattice(ROBOT, ARM, (0.3, 0.6)), corrected if wrapped else plant, marker=MARKER, seed=1)
        agent.learn([ReachTarget(np.array([-0.25, 0.2, 0.1])), ReachTarget(np.array([-0.2, 0.25, 0.2]))], 6)
        steps.append((agent.steps, repr(agent.last), plant.q.tobytes()))
    assert steps[0] == steps[1]


def test_a_plant_of_another_robot_is_refused() -> None:
    with pytest.raises(InvalidValue, match="use one robot"):
        SelfCalibratingPlant(OfflinePlant(Model(load_robot("katana"))), JointOffsets(MODEL, MARKER, ARM), lambda: None)
    with pytest.raises(InvalidValue, match="no target is presented"):
        SelfCalibratingPlant(OfflinePlant(Model(ROBOT)), JointOffsets(MODEL, MARKER, ARM), lambda: None).reach(PART, MARKER)
