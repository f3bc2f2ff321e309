# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue, UnknownName
from mobee.roadmap.ik import costs
from mobee.roadmap.ik.costs import angle_between, lengths, unit_vector, units, vector


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


def test_the_residual_of_hold_is_the_error_of_the_distance(free: mobee.Model, postures: np.ndarray) -> None:
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
    line = pose.position("right_palm")[0] - pose.position("left_palm")[0]
    line /= np.linalg.norm(line)
    angles = [np.arccos(pose.normal("left_palm")[0] @ line), np.arccos(-pose.normal("right_palm")[0] @ line)]
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


def test_the_constraints_term_sums_the_violations_of_clauses(free: mobee.Model, icub: mobee.Robot, postures: np.ndarray) -> None:
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


def test_every_term_has_the_same_values_for_a_batch_and_for_each_pose(free: mobee.Model, postures: np.ndarray) -> None:
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
        lambda: costs.balance([1.0, np.nan]),
        lambda: costs.home(0.1),
        lambda: costs.home([np.nan] * 41),
        lambda: costs.home("home"),
        lambda: costs.hold("left_palm", "right_palm", np.nan),
        lambda: costs.plane("left_palm", [0.0, 0.0, 1.0], np.inf),
        lambda: costs.plane("left_palm", [0.0, 0.0, 1.0], None),
        lambda: costs.plane("left_palm", [0.0, 0.0, 1.0], "far"),
        lambda: costs.plane("left_palm", [0.0, 0.0, 1.0], [0.1, 0.2]),
        lambda: costs.at_most("left_palm", [0.0, 0.0, 1.0], np.nan),
        lambda: costs.orientation("left_palm", "down"),
        lambda: costs.term(3.0),
    ],
)
def test_invalid_arguments_are_refused(make) -> None:
    with pytest.raises(InvalidValue):
        make()


def test_a_posture_of_another_robot_is_refused(free: mobee.Model, icub: mobee.Robot) -> None:
    with pytest.raises(InvalidValue, match=r"posture has 7 numbers; it must be \(41,\)"):
        costs.home([0.1] * 7).residual(free.evaluate(icub.home[None]))


def test_an_unknown_marker_is_refused(free: mobee.Model, icub: mobee.Robot) -> None:
    with pytest.raises(UnknownName, match="left_palm"):
        mobee.solve_ik(free, [costs.position("left_plam", [0.0, 0.0, 0.0])])


def test_relative_position_is_how_far_a_marker_is_from_a_place_that_goes_with_another(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    place = np.array([0.02, -0.01, -0.2])
    there = pose.position("left_palm") + (pose.rotation("left_palm") @ place[:, None])[..., 0]
    missing = costs.relative_position("right_palm", "left_palm", place).residual(pose)
    np.testing.assert_allclose(missing, np.linalg.norm(pose.position("right_palm") - there, axis=1), atol=1e-14)


def test_relative_orientation_is_the_turn_between_two_markers(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    between = pose.rotation("left_palm").swapaxes(-1, -2) @ pose.rotation("right_palm")
    missing = costs.relative_orientation("right_palm", "left_palm", np.eye(3)).residual(pose)
    np.testing.assert_allclose(missing, np.arccos((np.trace(between, axis1=1, axis2=2) - 1.0) / 2.0), atol=1e-7)
    assert costs.relative_orientation("right_palm", "left_palm", between[2]).residual(pose)[2] == pytest.approx(0.0, abs=1e-7)


def test_aligned_is_the_angle_between_directions_of_two_markers(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    fingers, thumb = pose.rotation("left_palm")[..., 0], -pose.rotation("right_palm")[..., 1]
    missing = costs.aligned("left_palm", "right_palm", (3.0, 0.0, 0.0), (0.0, -1.0, 0.0)).residual(pose)
    np.testing.assert_allclose(missing, np.arccos((fingers * thumb).sum(axis=1)), atol=1e-7)


def test_orientation_of_a_direction_of_the_markers_own(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    missing = costs.orientation("right_palm", (0.0, 0.0, 5.0), direction=(-2.0, 0.0, 0.0)).residual(pose)
    np.testing.assert_allclose(missing, np.arccos(-pose.rotation("right_palm")[:, 2, 0]), atol=1e-7)


def test_a_point_of_the_markers_frame_can_be_put_on_a_place(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    points = pose.position("left_palm") + (pose.rotation("left_palm") @ np.array([[0.1], [0.0], [-0.2]]))[..., 0]
    missing = costs.position("left_palm", points[1], offset=(0.1, 0.0, -0.2)).residual(pose)
    np.testing.assert_allclose(missing, np.linalg.norm(points - points[1], axis=1), atol=1e-14)


def test_across_is_the_angle_to_the_plane_across_an_axis(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    tilted = np.abs(np.pi / 2 - np.arccos(pose.normal("right_palm")[:, 2]))
    np.testing.assert_allclose(costs.across("right_palm", (0, 0, 3)).residual(pose), tilted, atol=1e-7)
    fingers = np.abs(np.pi / 2 - np.arccos(pose.rotation("right_palm")[:, 2, 0]))
    np.testing.assert_allclose(costs.across("right_palm", (0, 0, 3), (1, 0, 0)).residual(pose), fingers, atol=1e-7)


def test_plane_is_the_distance_to_it_on_either_side_and_at_most_that_beyond_it(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    heights = pose.position("left_elbow")[:, 2]
    middle = float(np.median(heights))
    np.testing.assert_allclose(costs.plane("left_elbow", (0, 0, 2), middle).residual(pose), np.abs(heights - middle), atol=1e-15)
    beyond = costs.at_most("left_elbow", (0, 0, 2), middle).residual(pose)
    np.testing.assert_allclose(beyond, np.maximum(heights - middle, 0.0), atol=1e-15)
    assert (beyond == 0.0).any() and (beyond > 0.0).any()


@pytest.mark.parametrize("goal", [np.diag([1.0, 1.0, -1.0]), np.eye(2), [[np.nan] * 3] * 3])
def test_an_invalid_rotation_is_refused(goal: np.ndarray) -> None:
    with pytest.raises(InvalidValue, match="goal is no rotation"):
        costs.relative_orientation("right_palm", "left_palm", goal)


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.5, np.pi / 2, 3.0, np.pi - 1e-6, np.pi])
def test_angles_are_exact_near_their_ends(angle: float) -> None:
    one, other = np.array([1.0, 0.0, 0.0]), np.array([np.cos(angle), np.sin(angle), 0.0])
    assert angle_between(one, other) == pytest.approx(angle, abs=1e-12)


def test_directions_have_length_one_and_nothing_stays_nothing(rng: np.random.Generator) -> None:
    given = rng.standard_normal((20, 3))
    np.testing.assert_allclose(lengths(units(given)), 1.0)
    np.testing.assert_allclose(units(given) * lengths(given)[:, None], given)
    np.testing.assert_array_equal(units(np.zeros(3)), np.zeros(3))


@pytest.mark.parametrize("given", [[1.0, 2.0], [[1.0, 2.0, 3.0]], [1.0, np.nan, 0.0]])
def test_a_vector_that_is_not_three_finite_numbers_is_refused_by_name(given: list[float]) -> None:
    with pytest.raises(InvalidValue, match="place"):
        vector("place", given)


def test_nothing_is_no_direction() -> None:
    with pytest.raises(InvalidValue, match="goal.*direction"):
        unit_vector("goal", [0.0, 0.0, 0.0])
