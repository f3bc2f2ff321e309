from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue, UnknownName
from mobee.roadmap.ik import costs


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def test_position_is_the_distance(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    there = pose.position("left_palm")[2]
    missing = costs.position("left_palm", there).residual(pose)
    np.testing.assert_allclose(missing, np.linalg.norm(pose.position("left_palm") - there, axis=1), atol=1e-15)
    assert missing[2] == 0.0 and (np.delete(missing, 2) > 0.0).all()


@pytest.mark.parametrize("angle", [0.0, 0.1, 2.0, 3.1])
def test_orientation_is_the_angle_of_the_whole_marker(free: mobee.Model, postures: np.ndarray, angle: float) -> None:
    pose = free.evaluate(postures[:1])
    goal = turn(np.array([1.0, 2.0, -1.0]), angle) @ pose.rotation("right_palm")[0]
    assert costs.orientation("right_palm", goal).residual(pose)[0] == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("angle", [0.0, 0.1, 2.0, 3.1])
def test_orientation_is_the_angle_of_the_normal(free: mobee.Model, postures: np.ndarray, angle: float) -> None:
    pose = free.evaluate(postures[:1])
    normal = pose.normal("right_palm")[0]
    across = np.cross(normal, [0.3, 0.2, 0.9])
    assert costs.orientation("right_palm", 7.0 * turn(across, angle) @ normal).residual(pose)[0] == pytest.approx(angle, abs=1e-9)


def test_hold_is_what_the_distance_misses(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    apart = np.linalg.norm(pose.position("left_palm") - pose.position("right_palm"), axis=1)
    np.testing.assert_allclose(costs.hold("left_palm", "right_palm", 0.3).residual(pose), np.abs(apart - 0.3), atol=1e-15)


def test_gaze_is_the_angle_to_a_place_or_a_marker(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures[:1])
    eyes, ahead = pose.position("head")[0], pose.normal("head")[0]
    assert costs.gaze(eyes + 2.0 * ahead).residual(pose)[0] == pytest.approx(0.0, abs=1e-7)
    assert costs.gaze(eyes - ahead).residual(pose)[0] == pytest.approx(np.pi, abs=1e-7)
    palm = pose.position("left_palm")[0]
    assert costs.gaze("left_palm").residual(pose)[0] == pytest.approx(costs.gaze(palm).residual(pose)[0], abs=1e-12)


def test_palms_face_each_other_when_both_normals_lie_on_the_line_between(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures[:1])
    way = pose.position("right_palm")[0] - pose.position("left_palm")[0]
    way /= np.linalg.norm(way)
    angles = [np.arccos(pose.normal("left_palm")[0] @ way), np.arccos(-pose.normal("right_palm")[0] @ way)]
    assert costs.palm_to_palm().residual(pose)[0] == pytest.approx(max(angles))


def test_home_counts_in_ranges(free: mobee.Model, icub: mobee.Robot) -> None:
    q = np.stack([icub.home, icub.home])
    q[1, 4] += 0.25 * (icub.limits[4, 1] - icub.limits[4, 0])
    np.testing.assert_allclose(costs.home().residual(free.evaluate(q)), [0.0, 0.25])
    np.testing.assert_allclose(costs.home(q[1]).residual(free.evaluate(q)), [0.25, 0.0])


def test_comfort_is_nothing_in_the_middle_and_one_at_the_limits(free: mobee.Model, icub: mobee.Robot) -> None:
    q = np.stack([icub.limits.mean(axis=1), icub.limits[:, 0], icub.limits[:, 1]])
    np.testing.assert_allclose(costs.comfort().residual(free.evaluate(q)), [0.0, 1.0, 1.0], atol=1e-12)


def test_balance_is_how_far_the_centre_of_mass_has_moved_aside(free: mobee.Model, icub: mobee.Robot) -> None:
    bent = icub.home.copy()
    bent[icub.motor_index("torso_pitch")] += 0.4
    pose = free.evaluate(np.stack([icub.home, bent]))
    masses = np.array([body.mass for body in icub.bodies])
    links = [body.link for body in icub.bodies]
    centres = np.array([pose.transforms[1, k] @ [*body.centre, 1.0] for k, body in zip(links, icub.bodies, strict=True)])
    centre = masses @ centres[:, :2] / masses.sum()
    missing = costs.balance().residual(pose)
    assert missing[0] == pytest.approx(0.0, abs=1e-12) and missing[1] > 0.01
    assert costs.balance([0.1, 0.2]).residual(pose)[1] == pytest.approx(np.linalg.norm(centre - [0.1, 0.2]))


def test_balance_needs_masses() -> None:
    katana = mobee.load_robot("katana")
    if katana.bodies:
        pytest.skip("it has masses by now")
    with pytest.raises(InvalidValue, match="mass"):
        costs.balance().residual(mobee.Model(katana).evaluate(katana.home[None]))


def test_constraints_are_what_the_clauses_miss(free: mobee.Model, icub: mobee.Robot, postures: np.ndarray) -> None:
    missing = costs.constraints().residual(free.evaluate(np.concatenate([icub.home[None], postures])))
    by_hand = [sum(max(0.0, -(c.a @ q + c.b).max()) for c in icub.clauses) for q in [icub.home, *postures]]
    np.testing.assert_allclose(missing, by_hand, atol=1e-12)
    assert missing[0] == 0.0 and missing.max() > 0.0


def test_collisions_are_those_of_solids(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    solid = [[c.depth for c in one.contacts if c.kind == "solid"] for one in pose.each()]
    assert any(solid)
    np.testing.assert_array_equal(costs.collision("count").residual(pose), [len(depths) for depths in solid])
    np.testing.assert_allclose(costs.collision().residual(pose), [sum(depths) for depths in solid])


def test_every_term_says_of_a_batch_what_it_says_of_each_pose(free: mobee.Model, postures: np.ndarray) -> None:
    palms = "left_palm", "right_palm"
    terms = [
        costs.position(palms[0], [-0.3, 0.0, 0.1]),
        costs.orientation(palms[0], [0.0, 0.0, 1.0]),
        costs.orientation(palms[1], np.eye(3)),
    ]
    terms += [costs.hold(*palms, 0.2), costs.palm_to_palm(), costs.gaze("left_palm"), costs.collision(), costs.collision("count")]
    terms += [costs.home(), costs.comfort(), costs.balance(), costs.constraints()]
    for one in terms:
        together = one.residual(free.evaluate(postures))
        assert together.shape == (len(postures),) and (together >= 0.0).all()
        np.testing.assert_allclose(together, [one.residual(free.evaluate(q[None]))[0] for q in postures], atol=1e-12)


@pytest.mark.parametrize(
    "make",
    [
        lambda: costs.position("left_palm", [0.0, 1.0]),
        lambda: costs.position("left_palm", [0.0, 1.0, np.nan]),
        lambda: costs.position("left_palm", [0.0, 1.0, 2.0], weight=0.0),
        lambda: costs.position("left_palm", [0.0, 1.0, 2.0], tolerance=-1.0),
        lambda: costs.orientation("left_palm", [0.0, 0.0, 0.0]),
        lambda: costs.orientation("left_palm", -np.eye(3)),
        lambda: costs.orientation("left_palm", 2.0 * np.eye(3)),
        lambda: costs.collision("deepest"),
        lambda: costs.balance([1.0]),
        lambda: costs.term(3.0),
    ],
)
def test_what_is_not_valid_is_refused(make) -> None:
    with pytest.raises(InvalidValue):
        make()


def test_an_unknown_marker_is_refused(free: mobee.Model, icub: mobee.Robot) -> None:
    with pytest.raises(UnknownName, match="left_palm"):
        mobee.solve_ik(free, [costs.position("left_plam", [0.0, 0.0, 0.0])])
