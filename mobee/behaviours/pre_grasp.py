# SPDX-License-Identifier: Apache-2.0
"""Paths to a pre-grasp, a pose beside an upright thing: a roadmap of such poses, and new plans after bumps (thesis 4.3.3).

A bump is an unexpected collision, detected by the torques of the motors.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array
from mobee.behaviours.bump import BumpWatch
from mobee.behaviours.grasp import UP, Grip, SideGrasp
from mobee.behaviours.pick import FAST, Body, Picker, PreGrasp, Upright, is_free, pre_grasps
from mobee.errors import MobeeError
from mobee.model.model import Model
from mobee.roadmap.building import tasks
from mobee.roadmap.building.build import RoadmapSettings, build_roadmap
from mobee.roadmap.ik import costs
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Robot

THUMB = (0.0, -1.0, 0.0)  # in the frame of a palm
MARKER, PART = "right_palm", "right_arm"
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw")
MOTORS = ("torso", *(f"r_{joint}" for joint in ARM))
WATCHED = ("torso_yaw", "r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw")
"""Names of the motors whose torques show that the right arm has bumped into something."""
PLACES = ((-0.45, -0.2), (0.0, 0.42), (0.0, 0.12))
"""Range of the palm's positions in the pre-grasp map, (low, high) m: x and y in the root frame, and height above that of a grasp."""
FACES = (0.0, float(np.deg2rad(60.0)))  # rad, azimuths
SPACING = (0.03, 0.03, 0.05, float(np.deg2rad(20.0)))  # m and rad
NEIGHBOURS, LONGEST, MARGIN = 16, 0.5, float(np.deg2rad(10.0))
ASIDE = (-0.24, 0.38, 0.0, float(np.deg2rad(30.0)))  # of a pose with the hand at the side of the table
PLANS = 8
AROUND, OVER = 0.05, 0.065
"""After a bump, the palm does not return to places within AROUND [m] horizontally and below OVER [m] above its position at the bump.

The space below is excluded too, because the object that was hit stands on the table.
"""
_LEFT = {"shoulder_pitch": -40.0, "shoulder_roll": 40.0, "shoulder_yaw": -30.0, "elbow": 100.0}  # degrees, the left arm aside
_RIGHT = {"shoulder_pitch": 0.0, "shoulder_roll": 80.0, "shoulder_yaw": -20.0, "elbow": 70.0}  # the right elbow away from the body


def icub_starts(robot: Robot) -> Array:
    """Return two start postures (2, n) rad for inverse kinematics of an iCub's right arm, with the left arm moved aside.

    In the second posture the right elbow is also away from the body.
    """
    aside = _changed(robot, robot.home, "l", _LEFT)
    return np.stack([aside, _changed(robot, aside, "r", _RIGHT)])


def pre_grasp_map(grasp: SideGrasp, ground: float) -> Roadmap:
    """Return a roadmap of postures with the thumb up; its task space is the palm's position and the azimuth it faces (thesis fig. 4.8).

    `ground`: height of the surface on which things stand [m]. The world of `grasp` should not contain the things. Building takes seconds.
    """
    low = ground + grasp.grip.height
    box = [*PLACES[:2], (low + PLACES[2][0], low + PLACES[2][1])]
    return build_roadmap(
        grasp.model,
        costs=[costs.orientation(grasp.marker, UP, direction=THUMB), costs.collision(), costs.home()],
        task=tasks.place(grasp.marker, "xyz", box) + tasks.angle(grasp.marker, (0, 0, -1), (0, -1, 0), *FACES),
        spacing=SPACING,
        start=grasp.starts[0],
        motors=list(grasp.motors),
        seed=0,
        settings=RoadmapSettings("least_squares", NEIGHBOURS, LONGEST, MARGIN),
    )


def aside(trm: Roadmap, ground: float, grip: Grip) -> Array:
    """Return a posture (n,) rad of a pre-grasp map with the hand at the side of the table, where it hides nothing from the cameras.

    `trm`: the pre-grasp map, a roadmap as `pre_grasp_map` returns it. `ground`: height of the surface on which things stand [m]. `grip`:
    gives the height of the palm above this surface.
    """
    posture: Array = trm.q[trm.exit(np.array(ASIDE) + np.array([0.0, 0.0, ground + grip.height, 0.0]))]
    return posture


class Planner(Protocol):
    """The interface of a planner of paths to pre-grasps."""

    def path(self, start: Array, goal: Array, azimuth: float, blocked: Array) -> Array | None:
        """Return a path (K, n) rad from a posture to a pre-grasp, or None if there is no path.

        Args:
            start: posture (n,) rad.
            goal: posture (n,) rad at the end of the path.
            azimuth: direction that the palm faces in `goal`, rad about the vertical axis; 0: the left (-y), pi / 2: the front (-x).
            blocked: positions (B, 3) m of the palm at earlier bumps, root frame; the palm must move around or over them.
        """
        ...


class MapPlanner:
    """A `Planner` that searches a path without contacts in the pre-grasp map.

    `trm`: the pre-grasp map, a roadmap as `pre_grasp_map` builds it. `world`: the robot in the world in which paths are checked. `marker`:
    name of the palm's marker.
    """

    def __init__(self, trm: Roadmap, world: Model, marker: str) -> None:
        self._map, self._world, self._marker = replace(trm, model=world), world, marker
        self._palms = trm.model.evaluate(trm.q).position(marker)

    def path(self, start: Array, goal: Array, azimuth: float, blocked: Array) -> Array | None:
        """Return a path (K, n) rad from `start` (n,) rad through the roadmap to `goal` (n,) rad, or None if there is no path.

        `azimuth`: direction that the palm faces in `goal` [rad]. `blocked`: (B, 3) m, positions of the palm at earlier bumps, root frame;
        the palm moves around or over them.
        """
        place = self._world.evaluate(goal).position(self._marker)
        try:
            path = self._without(blocked).path(start, [*place, azimuth], free=True)
        except MobeeError:
            return None
        whole = np.concatenate([path, goal[None]])
        return whole if is_free(self._world, whole[-2:]) and is_around(self._world, self._marker, whole, blocked) else None

    def _without(self, blocked: Array) -> Roadmap:
        """Return the map without the poses in which the palm is near a blocked position (see `near_any`), and without their edges.

        `blocked`: (B, 3) m, root frame.
        """
        if not len(blocked):
            return self._map
        kept = ~near_any(self._palms, blocked)
        number = np.cumsum(kept) - 1
        edges = self._map.edges[kept[self._map.edges].all(axis=1)]
        return replace(self._map, q=self._map.q[kept], y=self._map.y[kept], edges=number[edges])


def near_any(palms: Array, blocked: Array) -> NDArray[np.bool_]:
    """Return for each of the palm positions (P, 3) m whether it is near one of the blocked positions (B, 3) m: booleans (P,).

    A palm is near a blocked position if their horizontal distance is at most 5 cm, and the palm is lower or less than 6.5 cm higher.
    """
    beside = np.linalg.norm(palms[:, None, :2] - blocked[:, :2], axis=2) <= AROUND
    found: NDArray[np.bool_] = (beside & (palms[:, None, 2] < blocked[:, 2] + OVER)).any(axis=1)
    return found


def is_around(model: Model, marker: str, path: Array, blocked: Array) -> bool:
    """Return whether the marker stays away from the blocked positions (B, 3) m on a path (K, n) rad.

    Near is meant as in `near_any`: within 5 cm horizontally, and lower or less than 6.5 cm higher. The path may begin near a blocked
    position, but once it is away from all of them it must not come near one again. The result is also True for a path that is near blocked
    positions from its start to its end.
    """
    if not len(blocked):
        return True
    shares = np.linspace(0.0, 1.0, 10)[:, None, None]
    poses = (path[:-1] + shares * (path[1:] - path[:-1])).reshape(-1, path.shape[1])
    palms = model.evaluate(poses).position(marker)
    near = near_any(palms, blocked)
    return bool(near.all() or not near[int(near.argmin()) :].any())


@dataclass(slots=True)
class Approach:
    """The result of `approach`.

    `azimuth`: direction that the palm faces in the pre-grasp that was reached [rad]; None: none was reached. `bumps`: number of bumps.
    `plans`: how often a path was planned. `planning`: processor time for all planning [s].
    """

    azimuth: float | None = None
    bumps: int = 0
    plans: int = 0
    planning: float = 0.0


def approach(body: Body, picker: Picker, thing: Upright, plan: Planner) -> Approach:
    """Move the palm to a pre-grasp of a thing along planned paths, with a new plan after each bump (unexpected collision).

    `body`: the robot, which follows paths under the control law. `picker`: gives the grasp and the last motion to the pre-grasp. `plan`:
    the planner of paths. A new path must move around or over the positions of the palm at earlier bumps; if there is no such path, these
    positions are discarded. After a bump the pre-grasp is not tried again, and pre-grasps that are reached from above are preferred,
    because the obstacle that was hit is beside the thing. At most 8 plans are made.
    """
    found, model, blocked = Approach(), picker.grasp.model, np.empty((0, 3))
    watch = BumpWatch(model.robot, picker.watched)
    goals = pre_grasps(picker.grasp, thing)
    while found.plans < PLANS and goals:
        begun = time.process_time()
        chosen = _planned(goals, plan, body.q, blocked)
        if chosen is None and len(blocked):  # nothing leads around: perhaps there was nothing
            blocked = blocked[:0]
            chosen = _planned(goals, plan, body.q, blocked)
        found.planning, found.plans = found.planning + time.process_time() - begun, found.plans + 1
        if chosen is None:
            return found
        path, goal = chosen
        ended = body.follow_path(path, FAST, watch)
        if not ended.bumped and not picker.arrive(goal, watch):
            found.azimuth = goal.azimuth
            return found
        found.bumps += 1
        goals = sorted((one for one in goals if one is not goal), key=lambda one: not one.above)  # it is stable
        blocked = np.concatenate([blocked, model.evaluate(ended.q if ended.bumped else body.q).position(picker.grasp.marker)[None]])
    return found


def _planned(goals: Sequence[PreGrasp], plan: Planner, here: Array, blocked: Array) -> tuple[Array, PreGrasp] | None:
    """Return a path (K, n) rad to beside the thing, and the pre-grasp; None if there is no free path."""
    for goal in goals:
        path = plan.path(here, goal.away, goal.azimuth, blocked)
        if path is not None:
            return path, goal
    return None


def _changed(robot: Robot, q: ArrayLike, side: str, degrees: dict[str, float]) -> Array:
    found = np.array(q, dtype=np.float64)
    for joint, angle in degrees.items():
        found[robot.motor_index(f"{side}_{joint}")] = np.deg2rad(angle)
    return found
