# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue
from mobee.roadmap.playback import PERIOD, attractors, carrying, moving, play, timed

MOTORS = ("torso_yaw", "r_shoulder_pitch", "r_shoulder_roll", "r_elbow")


@pytest.fixture(scope="module")
def path(icub: mobee.Robot) -> np.ndarray:
    """In the open, away from limits."""
    start = icub.home.copy()
    where = [icub.motor_index(name) for name in MOTORS]
    start[where] = 0.0, -0.6, 0.9, 0.9
    steps = np.zeros((5, len(start)))
    steps[1:, where] = np.random.default_rng(2).normal(size=(4, len(where))) * 0.1
    return start + np.cumsum(steps, axis=0)


def test_the_robot_follows_the_path_to_its_end(free: mobee.Model, path: np.ndarray) -> None:
    played = play(free, path)
    assert played.rested
    assert played.solid.max() == 0.0 and played.deepest == ()
    assert played.lag < 0.02 and played.off < 0.015 and played.missing < 0.01  # 1 rad of way; encoders err by 0.001
    assert np.abs(played.q[0] - path[0]).max() < 0.01
    assert len(played.times) == len(played.q) == len(played.wanted) == len(played.field)


def test_the_same_seed_gives_the_same_motion(free: mobee.Model, path: np.ndarray) -> None:
    one, two, other = (play(free, path, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.q, two.q)
    assert not np.array_equal(one.q, other.q[: len(one.q)])


def test_it_is_faster_at_a_higher_speed(free: mobee.Model, path: np.ndarray) -> None:
    assert play(free, path, speed=0.9).times[-1] < play(free, path, speed=0.4).times[-1]


def test_an_obstacle_on_the_path_is_reported_and_pushes_the_robot_off_it(icub: mobee.Robot, path: np.ndarray) -> None:
    world = mobee.World()
    model = mobee.Model(icub, world)
    at = model.evaluate(path[-1]).position("right_palm")
    world.add("block", mobee.sphere(0.08), position=at)
    played = play(model, path)
    assert played.field.max() > 0.0
    assert played.missing > 0.05


def test_the_attractor_leads_and_ends_at_the_end(icub: mobee.Robot, path: np.ndarray) -> None:
    gains = mobee.Gains.default()
    wanted = timed(icub, path, gains)
    found = list(attractors(icub, wanted, gains))
    np.testing.assert_array_equal(found[-1], path[-1])
    assert len(found) == pytest.approx(wanted.times[-1] / PERIOD + 1.0, abs=1.0)
    assert ((found >= icub.limits[:, 0]) & (found <= icub.limits[:, 1])).all()
    still = np.ptp(path, axis=0) == 0.0
    np.testing.assert_array_equal(np.ptp(found, axis=0)[still], 0.0)


def test_only_parts_that_move_are_moved(icub: mobee.Robot, path: np.ndarray) -> None:
    assert moving(icub, path) == ("torso", "right_arm")


def test_a_part_is_carried_by_those_between_it_and_the_base(icub: mobee.Robot) -> None:
    assert carrying(icub, ["r_elbow"]) == ("torso", "right_arm")
    assert carrying(icub, ["torso_yaw"]) == ("torso",)


def test_invalid_paths_are_refused(free: mobee.Model, path: np.ndarray) -> None:
    beyond = path.copy()
    beyond[1, free.robot.motor_index("r_elbow")] = 3.0
    for given, text in ((path[:, :3], r"path has shape \(5, 3\)"), (path[:1], "leads nowhere"), (beyond, "r_elbow beyond its limits")):
        with pytest.raises(InvalidValue, match=text):
            play(free, given)
    with pytest.raises(InvalidValue, match=r"speed 2"):
        play(free, path, speed=2.0)
