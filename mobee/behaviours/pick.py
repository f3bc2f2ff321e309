# SPDX-License-Identifier: Apache-2.0
"""Picks up an upright thing and puts it down elsewhere, from a pre-grasp beside it (thesis 4.3.3, and what comes after it).

Each step is a motion of a `Body`, which is a plant in one process or the robot of the live system.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mobee.arrays import Array, Ints
from mobee.behaviours.bump import BumpWatch
from mobee.behaviours.grasp import SideGrasp, palm_beside
from mobee.errors import MobeeError
from mobee.model.model import Model
from mobee.roadmap.ik.problem import chosen

FAST, SLOW, GENTLE = 0.4, 0.3, 0.4  # shares of the largest speed: free motions, beside things, with the thing in the hand
AZIMUTHS = float(np.deg2rad(-20.0)), float(np.deg2rad(70.0))  # of the right hand
CLOSING, SQUEEZING = 2.0, 0.5  # s
LIFT = 0.1  # m
ABOVE = 0.004  # m above the height of the grasp at which the hand opens
STAND_OFF = 0.11  # m between thing and palm, from where the hand moves straight to the pre-grasp
RETREAT = 0.09  # m between thing and palm, to which the hand goes back
ENOUGH = float(np.deg2rad(0.7))  # rad from a posture, at which it is reached
CORRECTIONS, CALM = 4, 1.5  # of the attractor, for what forces keep the motors from a posture; s, at most, for each
BACK = 3.0  # s of a motion that are undone after a bump
STEP = 0.03  # rad between two postures of a motion that are checked for contacts
TURNS = tuple(np.deg2rad((0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0)).tolist())  # azimuths that are tried, beside the first one


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """The end of a motion along a path: whether something was bumped into, and the posture (n,) rad then."""

    bumped: bool
    q: Array


def places_near(thing: Array, azimuth: float, shifts: tuple[float, float], count: int, rng: np.random.Generator) -> Array:
    """Return random places (count, 2) m for a thing at (2,) m, those first where the hand came from: there it met nothing."""
    turns, far = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(*shifts, count)
    steps = far[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    back = np.array([np.sin(azimuth), np.cos(azimuth)])
    found: Array = thing + steps[np.argsort(-(steps @ back) / far, kind="stable")]
    return found


class Body(Protocol):
    """A robot that follows paths under the law."""

    @property
    def q(self) -> Array:
        """The encoders, (n,) rad."""
        ...

    def follow_path(self, path: Array, speed: float, watch: BumpWatch | None = None, offset: Array | None = None) -> Followed:
        """Move along a path (K, n) rad at a share of the largest speed; `watch`: ends it at a bump; `offset`: added to the attractor."""
        ...

    def press(self, q: Array, seconds: float, offset: Array | None = None) -> None:
        """Set the attractor to q (n,) rad at once, and leave it there for a time."""
        ...

    def rest_at(self, q: Array) -> None:
        """Set the attractor to q (n,) rad, and wait until nothing is commanded to move, or for CALM s."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Upright:
    """An upright thing as it is seen: the place of its axis (2,) m, radius and height [m], and the height [m] of what it stands on."""

    place: Array
    radius: float
    height: float
    ground: float


class NoPosture(MobeeError):
    """Raised if the robot has no posture, or no motion without contacts, for a step."""


def azimuth_beside(place: Array) -> float:
    """Return the azimuth [rad] that suits the iCub's right hand at a thing at (2,) m: the farther right, the more to the front."""
    return float(np.deg2rad(40.0) * np.clip((place[1] - 0.05) / 0.15, 0.0, 1.1))


def beside(grasp: SideGrasp, thing: Upright, azimuth: float, gap: float, above: float, starts: Array | None) -> Array | None:
    """Return the posture (n,) rad with the palm beside a thing, `above` m above the height of a grasp; None if there is none."""
    return grasp.posture(palm_beside(thing.place, thing.radius, azimuth, gap, thing.ground + above, grasp.grip), starts)


def pre_grasps(grasp: SideGrasp, thing: Upright) -> Iterator[tuple[float, Array, Array]]:
    """Yield azimuths [rad] and postures (n,) rad before and at pre-grasps from which the hand can move to the thing, the best first.

    In the first posture the whole hand is beside the thing: between it and the pre-grasp thumb and fingers are near the thing.
    """
    for turn in TURNS:
        azimuth = azimuth_beside(thing.place) + turn
        if not AZIMUTHS[0] <= azimuth <= AZIMUTHS[1]:
            continue
        inner = beside(grasp, thing, azimuth, grasp.grip.gap, 0.0, None)
        if inner is None:
            continue
        outer = beside(grasp, thing, azimuth, grasp.grip.before, 0.0, np.concatenate([inner[None], grasp.starts]))
        away = None if outer is None else beside(grasp, thing, azimuth, STAND_OFF, 0.0, np.concatenate([outer[None], grasp.starts]))
        if outer is not None and away is not None and is_free(grasp.model, np.stack([away, outer, inner])):
            yield azimuth, away, outer


class Picker:
    """Picks things up with one hand.

    Args:
        body: the robot.
        grasp: postures; the world of its model has what must not be touched, not the thing.
    """

    def __init__(self, body: Body, grasp: SideGrasp) -> None:
        self.body, self.grasp = body, grasp
        robot = grasp.model.robot
        self.motors: Ints = chosen(robot, grasp.motors)
        self._offset: Array | None = None
        self._there: Array | None = None  # (n,) rad, of the pre-grasp
        self._fingers: Array = grasp.closed(body.q)[grasp.hand.motors]  # rad, where they hold

    def stand(self, q: Array) -> Array:
        """Bring torso and arm to q (n,) rad against the forces on them; return the offset (n,) rad of the attractor that this needs.

        What remains after a settled motion is added to the attractor, a few times.
        """
        aim = q.copy()
        for number in range(CORRECTIONS + 1):
            self.body.rest_at(aim)
            remaining = np.zeros(len(q))
            remaining[self.motors] = (q - self.body.q)[self.motors]
            if np.abs(remaining).max() < ENOUGH or number == CORRECTIONS:
                break
            aim = np.clip(aim + remaining, *self.grasp.model.robot.limits.T)
        offset: Array = aim - q
        return offset

    def arrive(self, away: Array, pre_grasp: Array) -> None:
        """Move the hand, which is at `away` (n,) rad, straight to the pre-grasp (n,) rad; keep what the forces there need."""
        offset = self.stand(away)
        self.body.follow_path(np.stack([away, pre_grasp]), SLOW, offset=offset)
        self._offset = self.stand(pre_grasp)
        self._there = pre_grasp

    def close(self, thing: Upright, azimuth: float) -> None:
        """Move the palm from the pre-grasp to the thing, and close the hand; raises NoPosture."""
        here = self._known(thing, azimuth, self.grasp.grip.gap, 0.0)
        there = self.body.q if self._there is None else self._there
        self.body.follow_path(np.stack([there, here]), SLOW, offset=self._offset)
        self._offset = self.stand(here)
        # The fingers arrive before the thumb, which pushes the thing into them.
        self.body.press(self.grasp.closed(here), CLOSING, self._offset)
        self._fingers = self.grasp.squeezed(self.body.q)
        self.body.press(self._held(here), SQUEEZING, self._offset)

    def lift(self, thing: Upright, azimuth: float) -> None:
        """Lift the thing straight up; raises NoPosture."""
        up, start = self._held(self._known(thing, azimuth, self.grasp.grip.gap, LIFT)), self._held(self.body.q)
        self.body.follow_path(np.stack([start, up]), GENTLE, offset=self._offset)
        self._offset = self.stand(up)

    def slipped(self, thing: Upright, centre: Array) -> Array:
        """Return how far a thing whose centre is seen at (3,) m has slipped in the hand, (3,) m in the frame of the palm."""
        pose, grip, marker = self.grasp.model.evaluate(self.body.q), self.grasp.grip, self.grasp.marker
        gripped = np.array([grip.along, grip.height - 0.5 * thing.height, thing.radius + grip.gap])
        found: Array = pose.rotation(marker).T @ (centre - pose.position(marker)) - gripped
        return found

    def put(self, thing: Upright, places: Sequence[Array], slipped: Array, blocked: Callable[[Array], bool] = lambda path: False) -> Array:
        """Put what is in the hand down at the first of the places (2,) m that works, open the hand and retreat; return the place.

        `slipped`: (3,) m, see the method.  `blocked`: whether something blocks the thing on a path (K, n) rad.  Raises NoPosture.
        """
        here = self.body.q
        for place in places:
            azimuth = azimuth_beside(place)
            normal = np.array([-np.sin(azimuth), -np.cos(azimuth)])
            aside = slipped[0] * np.array([normal[1], -normal[0]]) + slipped[2] * normal
            there = Upright(place - aside, thing.radius, thing.height, thing.ground + max(slipped[1], 0.0))
            up = beside(self.grasp, there, azimuth, self.grasp.grip.gap, LIFT, here[None])
            down = None if up is None else beside(self.grasp, there, azimuth, self.grasp.grip.gap, ABOVE, up[None])
            back = None if down is None else beside(self.grasp, there, azimuth, RETREAT, ABOVE, down[None])
            if up is None or down is None or back is None:
                continue
            path = np.stack([self._held(q) for q in (here, up, down)])
            if is_free(self.grasp.model, path) and not blocked(path):
                self._set_down(path, back)
                return place
        raise NoPosture(f"none of {len(places)} places on the table can be reached with the thing in the hand")

    def _set_down(self, path: Array, back: Array) -> None:
        self.body.follow_path(path[:2], GENTLE, offset=self._offset)
        # At the end of the motion down nothing is corrected: the thing may have tilted in the hand and stand already.
        offset = self.stand(path[1])
        self.body.follow_path(path[1:], SLOW, offset=offset)
        opened = self.grasp.opened(path[2])
        self.body.follow_path(np.stack([path[2], opened]), FAST, offset=offset)
        self.body.follow_path(np.stack([opened, back]), SLOW, offset=offset)
        self._offset = None

    def _held(self, q: Array) -> Array:
        """Return q (n,) rad with the fingers as they hold the thing."""
        found = q.copy()
        found[self.grasp.hand.motors] = self._fingers
        return found

    def _known(self, thing: Upright, azimuth: float, gap: float, above: float) -> Array:
        found = beside(self.grasp, thing, azimuth, gap, above, self.body.q[None])
        if found is None:
            found = beside(self.grasp, thing, azimuth, gap, above, None)
        if found is None:
            raise NoPosture(f"no posture with the palm {1e3 * gap:.0f} mm beside the thing at {thing.place.round(3).tolist()} m")
        return found


def is_free(model: Model, path: Array) -> bool:
    """Return whether a path (K, n) rad has no contacts of solids in the world of a model; its first posture is not checked."""
    return not touches(model, path)


def touches(model: Model, path: Array) -> bool:
    """Return whether solids touch in postures along a path (K, n) rad, about STEP apart, without its first one."""
    pieces = []
    for start, end in zip(path, path[1:], strict=False):
        count = max(1, int(np.ceil(np.abs(end - start).max() / STEP)))
        pieces.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return bool(np.any(model.evaluate(np.concatenate(pieces)).count))
