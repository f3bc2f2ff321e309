# SPDX-License-Identifier: Apache-2.0
"""Fingers: which they are, open and closed, around a ball, and moved by the plant."""

from __future__ import annotations

import numpy as np
import pytest

from mobee.behaviours.grasp import Hand
from mobee.errors import InvalidValue
from mobee.model import World, sphere
from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.simulation import OfflinePlant

ROBOT = load_robot("icub")
HAND = Hand(ROBOT, "right_palm")
ARM = ROBOT.part("right_arm")


def around_the_ball(radius: float) -> tuple[Model, np.ndarray, tuple[str, ...]]:
    """The model with a ball before the right palm, and the hand closed around it."""
    world, home = World(), Model(ROBOT).evaluate(ROBOT.home)
    world.add("ball", sphere(radius), position=home.position("right_palm") + (radius + 0.01) * home.normal("right_palm"))
    model = Model(ROBOT, world)
    return model, *HAND.closed_around(model, ROBOT.home)


@pytest.mark.parametrize(("marker", "side"), [("left_palm", "l"), ("right_palm", "r")])
def test_fingers_are_the_motors_beyond_the_palm_and_close_towards_it(marker: str, side: str) -> None:
    hand = Hand(ROBOT, marker)
    assert [ROBOT.motors[i] for i in hand.motors] == [
        f"{side}_{name}" for name in (
            "hand_finger", "thumb_oppose", "thumb_proximal", "thumb_distal", "index_proximal", "index_distal", "middle_proximal",
            "middle_distal", "pinky",
        )
    ]  # fmt: skip
    assert hand.closed.tolist() == ROBOT.limits[hand.motors, 1].tolist() and hand.open.tolist() == ROBOT.limits[hand.motors, 0].tolist()


def test_a_hand_that_closes_stops_at_what_it_touches() -> None:
    model, q, touched = around_the_ball(0.025)
    assert touched == ("ball",)
    assert (np.abs(q[HAND.motors] - HAND.closed) > 0.2).sum() >= 7
    deepest = max(c.depth for c in model.evaluate(q).contacts if c.kind == "solid" and c.second == "ball")
    assert 0.0 < deepest < 0.004  # one step of closing
    _, wider, _ = around_the_ball(0.035)
    assert wider[HAND.motors].sum() < q[HAND.motors].sum()


def test_a_hand_that_touches_nothing_closes_and_the_arm_does_not_move() -> None:
    q, touched = HAND.closed_around(Model(ROBOT), ROBOT.home)
    assert touched == () and q[HAND.motors].tolist() == HAND.closed.tolist()
    others = np.setdiff1d(np.arange(len(ROBOT.motors)), HAND.motors)
    assert q[others].tolist() == ROBOT.home[others].tolist()


def test_the_plant_opens_and_closes_it() -> None:
    plant = OfflinePlant(Model(ROBOT), active=["right_arm"])
    for share in (0.5, 0.15):
        outcome = plant.act("right_arm", HAND.posture(plant.q, share)[ARM.slice])
        assert np.abs(outcome.q - HAND.posture(plant.q, share)[ARM.slice]).max() < np.deg2rad(6.0)


def test_what_has_no_fingers_or_is_no_share_is_refused() -> None:
    with pytest.raises(InvalidValue, match="head of 'icub' has no fingers"):
        Hand(ROBOT, "head")
    with pytest.raises(InvalidValue, match="share 1.5"):
        HAND.posture(ROBOT.home, 1.5)
