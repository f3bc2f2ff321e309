# SPDX-License-Identifier: Apache-2.0
"""Torso assist: a target out of reach comes into it."""

from __future__ import annotations

import numpy as np
import pytest

from mobee.behaviours.assist import Assist, base_link, learned_worth, manipulability_worth
from mobee.errors import InvalidValue
from mobee.learning.lattice import Lattice
from mobee.learning.reaching.predictors import PREDICTORS
from mobee.learning.reaching.reaches import reaches_of
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.reach import ReachTarget
from mobee.robot.load import load_robot
from mobee.simulation import OfflinePlant
from tests.mobee.control.test_slides import with_units
from tests.mobee.planar import planar_arm

ROBOT = load_robot("icub")
TORSO = ROBOT.part("torso").slice
FAR = np.array([-0.5, 0.15, 0.1])  # 10 cm beyond the reach of the right arm
ARM = ("r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow")


@pytest.fixture(scope="module")
def assist() -> Assist:
    return Assist(Model(ROBOT, load_world("table")), "torso", "right_arm", manipulability_worth(ROBOT, "right_arm", "right_palm"))


def missing(torso: np.ndarray) -> float:
    """m by which the right palm misses the surface of a ball at FAR, from a posture of the torso."""
    plant = OfflinePlant(Model(ROBOT), active=["torso", "right_arm"])
    plant.act("torso", torso)
    plant.present(ReachTarget(FAR, 0.03, "surface"))
    return plant.reach("right_arm", "right_palm", stay=True).missing


def test_a_target_out_of_reach_comes_into_reach(assist: Assist) -> None:
    chosen = assist.posture(ROBOT.home, FAR)
    assert chosen.worth > 0.0 > chosen.worth_now
    assert missing(ROBOT.home[TORSO]) > 0.08
    assert missing(chosen.q) < 0.02


def test_where_the_arm_reaches_well_the_torso_stays(assist: Assist) -> None:
    chosen = assist.posture(ROBOT.home, np.array([-0.3, 0.2, 0.1]))
    assert chosen.q.tolist() == ROBOT.home[TORSO].tolist() and chosen.worth == chosen.worth_now > 0.5


def test_no_posture_in_contact_is_chosen(assist: Assist, rng: np.random.Generator) -> None:
    moved = 0
    for _ in range(8):
        chosen, q = assist.posture(ROBOT.home, rng.uniform([-0.5, -0.1, -0.1], [-0.2, 0.4, 0.4])), ROBOT.home.copy()
        q[TORSO] = chosen.q
        moved += chosen.q.any()
        assert int(assist.model.evaluate(q).count) == 0
    assert moved > 1


def test_the_torso_brings_the_target_to_the_best_place_in_the_frame_of_the_arm() -> None:
    best = np.array([-0.28, 0.22, 0.12])
    assist = Assist(Model(ROBOT), "torso", "right_arm", lambda places: np.exp(-((places - best) ** 2).sum(axis=1) / 0.05**2))
    base, q = base_link(ROBOT, "right_arm"), ROBOT.home.copy()

    def seen_from_home(place: np.ndarray) -> np.ndarray:
        at = np.linalg.solve(link_transforms(ROBOT, q)[base], np.append(place, 1.0))
        return (link_transforms(ROBOT, ROBOT.home)[base] @ at)[:3]

    q[TORSO] = np.deg2rad([20.0, 0.0, 15.0])
    target = (link_transforms(ROBOT, q)[base] @ np.linalg.solve(link_transforms(ROBOT, ROBOT.home)[base], np.append(best, 1.0)))[:3]
    assert np.linalg.norm(target - best) > 0.08
    chosen = assist.posture(ROBOT.home, target)
    q[TORSO] = chosen.q
    assert np.linalg.norm(seen_from_home(target) - best) < 0.04
    assert chosen.worth > 0.5 > chosen.worth_now


@pytest.mark.parametrize("unit", [1.0, 0.05, 0.3])
def test_a_trunk_that_slides_moves_as_one_that_turns(unit: float) -> None:
    """In its own unit: up to 10 degrees before its limit, with the same cost."""
    robot = with_units(np.array([unit, 1.0, 1.0]))
    chosen = Assist(Model(robot), "trunk", "arm", lambda places: np.linspace(0.0, 1.0, len(places)), levels=3).posture(np.zeros(3), FAR)
    assert chosen.q == pytest.approx([unit * np.deg2rad(90.0)])


@pytest.mark.parametrize(
    ("change", "message"),
    [({"q": np.full(41, np.nan)}, "q: number 0"), ({"q": np.zeros(3)}, "q of shape"), ({"target": FAR * np.nan}, "target: number 0")],
)
def test_an_invalid_posture_or_target_is_refused(assist: Assist, change: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        assist.posture(**{"q": ROBOT.home, "target": FAR} | change)


def test_a_number_of_levels_may_be_of_numpy() -> None:
    assist = Assist(Model(ROBOT), "torso", "right_arm", lambda places: places[:, 0], levels=np.int64(3))  # type: ignore[arg-type]
    assert len(assist._postures) == 27


@pytest.mark.parametrize("levels", [-1, 0, 1, 2.0, True])
def test_a_number_of_levels_is_whole(levels: int) -> None:
    with pytest.raises(InvalidValue, match="levels=.*2 or more"):
        Assist(Model(ROBOT), "torso", "right_arm", lambda places: places[:, 0], levels=levels)


def test_the_map_of_a_reach_learner_is_the_best_that_it_predicts() -> None:
    space, place = Lattice(ROBOT, joints=ARM), np.array([-0.28, 0.22, 0.12])
    predictor = PREDICTORS["weighted"](reaches_of(space, "right_palm", 0.01))
    predictor.add(7, place, 0.9, 0.5)
    far = place + 1.0
    assert learned_worth(predictor)(np.stack([place, far])).tolist() == [predictor.mean(place).max(), predictor.mean(far).max()]


def test_a_part_that_does_not_carry_the_arm_is_refused() -> None:
    with pytest.raises(InvalidValue, match="head of 'icub' does not carry right_arm"):
        Assist(Model(ROBOT), "head", "right_arm", lambda places: np.zeros(len(places)))


def test_an_arm_that_moves_in_a_plane_has_no_manipulability() -> None:
    with pytest.raises(InvalidValue, match="arm cannot move tip in three directions"):
        manipulability_worth(planar_arm(), "arm", "tip")
