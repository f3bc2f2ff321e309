# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mobee
from mobee import Controller, Model
from mobee.behaviours.bump import START, THRESHOLD, TICKS, BumpWatch
from mobee.behaviours.grasp import Grip, SideGrasp, palm_beside
from mobee.behaviours.pick import Picker, Upright, is_free, places_near, pre_grasps
from mobee.behaviours.pre_grasp import MARKER, MOTORS, WATCHED, MapPlanner, aside, icub_starts, is_around, pre_grasp_map
from mobee.control.gains import Gains
from mobee.model.masses import gravity_torque
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Robot

GROUND, RADIUS = -0.1, 0.028
CUP = Upright(np.array([-0.35, 0.1]), RADIUS, 0.13, GROUND)
DT = 0.01


@cache
def robot() -> Robot:
    return mobee.load_robot("icub")


@cache
def grasp() -> SideGrasp:
    world = mobee.load_world("table")
    world.remove("ball")
    return SideGrasp(Model(robot(), world), MARKER, MOTORS, icub_starts(robot()))


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.5, 1.5), st.floats(0.0, 0.2))
def test_a_palm_beside_a_thing_faces_its_axis_with_the_thumb_up(x: float, y: float, azimuth: float, gap: float) -> None:
    grip = Grip()
    palm = palm_beside([x, y], RADIUS, azimuth, gap, GROUND, grip)
    np.testing.assert_allclose(palm.rotation.T @ palm.rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(palm.rotation) == pytest.approx(1.0)
    axis = palm.rotation.T @ (np.array([x, y, GROUND + grip.height]) - palm.position)  # of the thing, in the palm's frame
    np.testing.assert_allclose(axis, (grip.along, 0.0, RADIUS + gap), atol=1e-12)
    np.testing.assert_allclose(-palm.rotation[:, 1], (0.0, 0.0, 1.0), atol=1e-12)


def test_pre_grasps_are_where_they_should_be_and_touch_nothing() -> None:
    goal = pre_grasps(grasp(), CUP)[0]
    azimuth, q = goal.azimuth, goal.posture
    pose, wanted = grasp().model.evaluate(q), palm_beside(CUP.place, RADIUS, azimuth, Grip().before, GROUND, Grip())
    np.testing.assert_allclose(pose.position(MARKER), wanted.position, atol=5e-3)
    assert np.arccos(np.trace(pose.rotation(MARKER).T @ wanted.rotation) / 2.0 - 0.5) < np.deg2rad(5.0)
    assert pose.count == 0
    low, high = robot().limits.T
    moved = [robot().motor_index(name) for name in robot().motors if name.startswith(("torso", "r_shoulder", "r_elbow", "r_wrist"))]
    assert (np.minimum(q - low, high - q)[moved] > np.deg2rad(9.9)).all()  # where the law does not push inward


def test_a_thing_fits_into_the_open_hand_which_touches_it_from_both_sides_as_it_closes() -> None:
    world = mobee.load_world("table")
    world.remove("ball")
    hand = SideGrasp(Model(robot(), world), MARKER, MOTORS, icub_starts(robot()))
    goal = pre_grasps(hand, CUP)[0]
    azimuth, outer = goal.azimuth, goal.posture
    inner = hand.posture(palm_beside(CUP.place, RADIUS, azimuth, Grip().gap, GROUND, Grip()), outer[None])
    assert inner is not None
    world.add("cup", mobee.cylinder(RADIUS, 0.13), position=(*CUP.place, GROUND + 0.066))
    assert is_free(hand.model, np.stack([outer, inner]))
    closing = hand.opened(inner) + np.linspace(0.0, 1.0, 20)[:, None] * (hand.closed(inner) - hand.opened(inner))
    touching = {contact.first for q in closing for contact in hand.model.evaluate(q).contacts if contact.kind == "solid"}
    assert any("thumb" in name for name in touching)
    assert any("index" in name or "middle" in name for name in touching)
    fingers = hand.squeezed(hand.opened(inner))
    assert np.abs(fingers - hand.opened(inner)[hand.hand.motors]).max() == pytest.approx(Grip().squeeze)


def test_the_law_holds_postures_against_its_forces_with_the_attractors_of_a_grasp() -> None:
    hand, near = grasp(), Upright(np.array([-0.3, 0.05]), RADIUS, 0.13, GROUND)  # near to the body, whose fields push the forearm
    goal = pre_grasps(hand, near)[0]
    azimuth, q = goal.azimuth, goal.posture
    inner = hand.posture(palm_beside(near.place, RADIUS, azimuth, Grip().gap, GROUND, Grip()), q[None])
    assert inner is not None
    assert 1.0 < hand.push(inner) < 6.0
    law = Controller(hand.model)
    moved = np.abs(hand.forces(inner)) > 0.0
    drifts = []
    for attractor in (hand.attractor(inner), inner):
        law.reset(inner)
        law.attractor = attractor
        here = inner.copy()
        for _ in range(200):
            here = here + DT * law.step(here, DT, pose=hand.model.evaluate(here, reaching=MARKER)).velocity
        drifts.append(float(np.abs(here - inner)[moved].max()))
    assert drifts[0] < np.deg2rad(0.01)
    assert drifts[1] > np.deg2rad(1.0)


def test_pre_grasps_keep_out_of_the_zones_of_the_clauses() -> None:
    gains, units = Gains.default(), motor_units(robot())
    for cup in (CUP, Upright(np.array([-0.3, 0.05]), RADIUS, 0.13, GROUND)):
        q = pre_grasps(grasp(), cup)[0].posture
        for clause in robot().clauses:
            if clause.part in ("torso", "right_arm"):
                zones = gains.constraint_width * np.linalg.norm(clause.a * units, axis=1)
                assert (clause.a @ q + clause.b >= zones - 1e-9).any()


def test_there_is_no_pre_grasp_where_things_fill_the_room_of_the_hand() -> None:
    world = mobee.load_world("table")
    world.remove("ball")
    world.add("wall", mobee.box(0.3, 0.02, 0.2), position=(-0.3, 0.16, 0.0))
    assert not pre_grasps(SideGrasp(Model(robot(), world), MARKER, MOTORS, icub_starts(robot())), CUP)


def test_a_path_of_one_posture_is_free() -> None:
    """Its first posture is not checked."""
    assert is_free(grasp().model, robot().home[None])


def test_what_another_hand_carries_stays_in_it_in_plans_to_put_a_thing_down() -> None:
    model = Model(robot(), mobee.load_world("table"))
    hold = robot().home.copy()
    held = model.evaluate(hold).position("left_palm")
    model.world.add("tool", mobee.sphere(0.02), position=held)
    model.attach("tool", robot().links[robot().marker("left_palm").link], hold)
    picker = Picker(Still(hold), SideGrasp(model, MARKER, MOTORS, icub_starts(robot())), WATCHED)
    found = picker._model_with(CUP, np.zeros(3))
    moved = hold.copy()
    moved[robot().motor_index("l_shoulder_roll")] += 0.3
    for q in (hold, moved):
        np.testing.assert_allclose(found.evaluate(q).objects["tool"].position, model.evaluate(q).position("left_palm"), atol=1e-12)


@dataclass
class Still:
    """A body that does not move."""

    q: np.ndarray

    def follow_path(self, path, speed, watch=None, forces=None):
        raise NotImplementedError

    press = rest_at = follow_path


def test_places_where_the_hand_came_from_are_first() -> None:
    rng = np.random.default_rng(0)
    places = places_near(CUP.place, 0.3, (0.07, 0.16), 24, rng)
    steps = places - CUP.place
    far = np.linalg.norm(steps, axis=1)
    assert ((far >= 0.07) & (far <= 0.16)).all()
    along = steps @ (np.sin(0.3), np.cos(0.3)) / far
    assert (np.diff(along) <= 1e-12).all()
    assert along[0] > 0.9


def torques(extra: float) -> np.ndarray:
    found = gravity_torque(robot(), robot().home)
    found[robot().motor_index("r_shoulder_yaw")] += extra
    return found


@pytest.mark.parametrize(
    ("jump", "ticks", "bumps"), [(1.2 * THRESHOLD, TICKS, True), (1.2 * THRESHOLD, TICKS - 1, False), (0.5, 40, False)]
)
def test_a_bump_is_a_jump_of_what_gravity_does_not_explain(jump: float, ticks: int, bumps: bool) -> None:
    watch, home = BumpWatch(robot(), WATCHED), robot().home
    for _ in range(round(START / DT) + 20):
        assert not watch.note(home, torques(0.0), DT)
    assert any([watch.note(home, torques(jump), DT) for _ in range(ticks)]) == bumps
    assert not watch.note(home, torques(0.0), DT)


@pytest.mark.parametrize("wrong", [{"q": np.nan}, {"torques": np.nan}, {"dt": np.nan}])
def test_a_measurement_that_is_not_finite_is_refused_and_bumps_are_still_detected(wrong: dict[str, float]) -> None:
    watch, given = BumpWatch(robot(), WATCHED), {"q": robot().home, "torques": torques(0.0), "dt": DT}
    for _ in range(round(START / DT) + 20):
        watch.note(**given)
    with pytest.raises(mobee.InvalidValue, match=next(iter(wrong))):
        watch.note(**given | {name: value + 0.0 * given[name] for name, value in wrong.items()})
    assert any([watch.note(robot().home, torques(1.2 * THRESHOLD), DT) for _ in range(TICKS)])


def test_a_watch_that_could_never_detect_a_bump_is_refused() -> None:
    with pytest.raises(mobee.InvalidValue, match="none is named"):
        BumpWatch(robot(), [])
    for threshold in (0.0, -1.0, np.nan, np.inf, "a", None):
        with pytest.raises(mobee.InvalidValue, match="threshold"):
            BumpWatch(robot(), WATCHED, threshold)


def test_torques_that_change_slowly_or_at_the_start_are_no_bump() -> None:
    watch, home = BumpWatch(robot(), WATCHED), robot().home
    assert not any([watch.note(home, torques(5.0 * (k < 100)), DT) for k in range(150)])
    watch.begin()
    assert not any([watch.note(home, torques(0.004 * k), DT) for k in range(800)])


def test_a_map_leads_around_places_where_the_arm_bumped_into_something() -> None:
    trm = pre_grasp_map(grasp(), GROUND)
    planner, start = MapPlanner(trm, grasp().model, MARKER), aside(trm, GROUND, Grip())
    first = pre_grasps(grasp(), CUP)[0]
    azimuth, goal = first.azimuth, first.away
    path = planner.path(start, goal, azimuth, np.empty((0, 3)))
    assert path is not None
    bump = grasp().model.evaluate(path[2]).position(MARKER)
    assert not is_around(grasp().model, MARKER, path, bump[None])
    around = planner.path(start, goal, azimuth, bump[None])
    assert around is not None
    assert is_around(grasp().model, MARKER, around, bump[None])
    assert is_free(grasp().model, around)
