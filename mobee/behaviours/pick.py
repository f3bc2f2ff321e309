# SPDX-License-Identifier: Apache-2.0
"""Picks up an upright thing and puts it down elsewhere, starting at a pre-grasp beside the thing (thesis 4.3.3, and further steps).

Each step is a motion of a `Body`: a robot that is simulated in this process (an offline plant), or the robot of the live system.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mobee.arrays import Array, Ints
from mobee.behaviours.bump import BumpWatch
from mobee.behaviours.grasp import SideGrasp, palm_beside
from mobee.errors import MobeeError
from mobee.model.model import Model
from mobee.model.world import World
from mobee.model.world_object import Geometry, cylinder
from mobee.roadmap.ik.problem import chosen

FAST, SLOW, GENTLE = 0.4, 0.3, 0.4  # shares of the largest speed: free motions, beside things, with the thing in the hand
AZIMUTHS = float(np.deg2rad(-20.0)), float(np.deg2rad(70.0))  # of the right hand
CLOSING, SQUEEZING = 2.0, 0.5  # s
LIFT = 0.08  # m: higher, the forearm comes nearer to the body
ABOVE = 0.004  # m above the height of the grasp at which the hand opens
AWAY, HIGH = (0.11, 0.095), 0.1  # m between thing and palm, and m above the pre-grasp, from where the hand moves straight to it
PUTS = 3  # places at which it tries to put a thing down
NEAR = 0.7  # share of the motion down on which bumps are noticed: after it the thing may touch what it will stand on
BUMPED = 0.06  # m around a place with a bump, in which no other is tried
CARRIED, CLEAR = "carried", 0.005  # name of the thing in the hand in plans; m by which it is enlarged there
RETREAT = 0.09  # m between thing and palm, to which the hand goes back
ENOUGH = float(np.deg2rad(0.7))  # rad from a posture, at which it is reached
CORRECTIONS, CALM = 4, 1.5  # of the attractor, for what forces keep the motors from a posture; s, at most, for each
BACK = 3.0  # s of a motion that are undone after a bump
FARTHEST = 0.7  # rad between two of the last postures before the thing: with more, the palm would leave the straight line
LITTLE_PUSH = 1.5  # rad/s^2 of the law on a motor, which the attractor makes up for
STEP = 0.03  # rad between two postures of a motion that are checked for contacts
TURNS = tuple(np.deg2rad(sorted(np.arange(45.0, -46.0, -7.5), key=abs)).tolist())  # azimuths that are tried, beside the first one


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """The end of a motion along a path.

    `bumped`: whether the motion ended early because the robot bumped into something. `q`: (n,) rad, the posture at the end.
    """

    bumped: bool
    q: Array


def places_near(thing: Array, azimuth: float, shifts: tuple[float, float], count: int, rng: np.random.Generator) -> Array:
    """Return random places (count, 2) m to which a thing at `thing` (2,) m can be moved, root frame.

    `shifts`: smallest and largest distance of the places from the thing [m]. `count`: number of places. The places on the side from which
    the hand came are first, because the hand met nothing there. `azimuth`: direction that the palm faced in the grasp, rad; 0: the left
    (-y), pi / 2: the front (-x). `rng`: draws the places.
    """
    turns, far = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(*shifts, count)
    steps = far[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    back = np.array([np.sin(azimuth), np.cos(azimuth)])
    found: Array = thing + steps[np.argsort(-(steps @ back) / far, kind="stable")]
    return found


Forces = Callable[[Array], Array]
"""A function that takes a posture (n,) rad and returns the control law's forces without spring and damping, (n,) rad/s^2."""


class Body(Protocol):
    """The interface of a robot that follows paths under the control law."""

    @property
    def q(self) -> Array:
        """The encoder values of all motors, (n,) rad."""
        ...

    def follow_path(self, path: Array, speed: float, watch: BumpWatch | None = None, forces: Forces | None = None) -> Followed:
        """Move along a path, postures (K, n) rad, and return how the motion ended.

        `speed`: share of the largest speed, above 0 and at most 1. `watch`: detects bumps; at a bump the robot moves back a little and the
        motion ends; None: bumps are not detected. `forces`: function that takes a posture (n,) rad and returns the forces (n,) rad/s^2 of
        the control law except spring and damping. The attractor (the goal of the spring) is shifted such that the spring cancels these
        forces; None: they are not cancelled.
        """
        ...

    def press(self, q: Array, seconds: float) -> None:
        """Set the attractor (the goal of the control law's spring) to q (n,) rad at once, and leave it there for `seconds`."""
        ...

    def rest_at(self, q: Array) -> None:
        """Set the attractor to q (n,) rad, and wait until the commanded motion has ended, but at most 1.5 s.

        The attractor is the goal of the control law's spring.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Upright:
    """An upright thing as the cameras see it.

    `place`: (2,) m, x and y of its axis, root frame. `radius`, `height`: m. `ground`: z of the surface on which it stands [m], root frame.
    """

    place: Array
    radius: float
    height: float
    ground: float


class NoPosture(MobeeError):
    """Raised if the robot has no posture for a step of picking or putting down, or no motion to it without contacts."""


def azimuth_beside(place: Array) -> float:
    """Return a suitable azimuth [rad] of the iCub's right palm beside a thing at `place` (2,) m, x and y in the root frame.

    The azimuth is the direction that the palm faces: 0: the left (-y), pi / 2: the front (-x). For things farther right the palm is turned
    more to the front.
    """
    return float(np.deg2rad(40.0) * np.clip((place[1] - 0.05) / 0.15, 0.0, 1.1))


def beside(grasp: SideGrasp, thing: Upright, azimuth: float, gap: float, above: float, starts: Array | None) -> Array | None:
    """Return the posture (n,) rad with the palm beside a thing, or None if there is none.

    `azimuth`: direction that the palm faces [rad], see `azimuth_beside`. `gap`: distance between palm and thing [m]. `above`: by how much
    the palm is higher than at a grasp [m]. `starts`: (S, n) rad, S postures from which inverse kinematics starts; None: those of `grasp`.
    """
    return grasp.posture(palm_beside(thing.place, thing.radius, azimuth, gap, thing.ground + above, grasp.grip), starts)


@dataclass(frozen=True, slots=True, eq=False)
class PreGrasp:
    """A pre-grasp: a posture with the palm beside a thing, from which the hand moves to the thing.

    `azimuth`: direction that the palm faces [rad], see `azimuth_beside`. `away`: (n,) rad, a posture farther from the thing, from which the
    hand moves straight to the pre-grasp. `posture`: (n,) rad, the pre-grasp. `above`: whether `away` is above the pre-grasp; else it is at
    the side.
    """

    azimuth: float
    away: Array
    posture: Array
    above: bool


def pre_grasps(grasp: SideGrasp, thing: Upright) -> list[PreGrasp]:
    """Return the pre-grasps from which the hand can move to the thing: first those that are reached from the side, then those from above.

    In both groups the best is first: the one with the smallest repulsive forces of the control law from the pre-grasp until the thing is
    lifted, because these forces displace the palm. The list is empty if no pre-grasp is found.
    """
    found: list[tuple[float, PreGrasp]] = []
    for turn in TURNS:
        azimuth = azimuth_beside(thing.place) + turn
        if not AZIMUTHS[0] <= azimuth <= AZIMUTHS[1]:
            continue
        inner = beside(grasp, thing, azimuth, grasp.grip.gap, 0.0, None)
        up = None if inner is None else beside(grasp, thing, azimuth, grasp.grip.gap, LIFT, inner[None])
        outer = None if inner is None else beside(grasp, thing, azimuth, grasp.grip.before, 0.0, inner[None])
        if inner is None or up is None or outer is None:
            continue
        push = max(LITTLE_PUSH, *(grasp.push(q) for q in (outer, inner, up)))
        for gap, above in (*((gap, 0.0) for gap in AWAY), (grasp.grip.before, HIGH)):
            away = beside(grasp, thing, azimuth, gap, above, outer[None])
            if away is None:
                continue
            path = np.stack([away, outer, inner])
            if np.abs(np.diff(path, axis=0)).max() <= FARTHEST and is_free(grasp.model, path):
                found.append((push, PreGrasp(azimuth, away, outer, above > 0.0)))
    return [one for _, one in sorted(found, key=lambda each: (each[1].above, each[0]))]


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """A motion of the hand that puts a thing down at a place.

    `place`: (2,) m, x and y in the root frame. `path`: (3, n) rad, the posture at the start, above the place, and at the place. `back`:
    (n,) rad, the posture to which the hand retreats.
    """

    place: Array
    path: Array
    back: Array


class Picker:
    """Picks up things with one hand and puts them down.

    Args:
        body: the robot.
        grasp: finds postures; the world of its model contains the objects that must not be touched, but not the thing to be picked.
        watched: names of the motors by whose torques bumps (unexpected collisions) are detected.
    """

    def __init__(self, body: Body, grasp: SideGrasp, watched: Sequence[str]) -> None:
        self.body, self.grasp, self.watched = body, grasp, tuple(watched)
        robot = grasp.model.robot
        self.motors: Ints = chosen(robot, grasp.motors)
        self._there: Array | None = None  # (n,) rad, of the pre-grasp
        self._passed: list[Array] = []  # (n,) rad, beside the thing, at it, and above with it
        self._fingers: Array = grasp.closed(body.q)[grasp.hand.motors]  # rad, where they hold

    def settle_at(self, q: Array) -> Array:
        """Move torso and arm to the posture q (n,) rad as exactly as possible; return the attractor (n,) rad that was needed for this.

        The attractor is the goal of the control law's spring. Each time the robot has come to rest, the remaining error of the posture is
        added to the attractor, at most four times.
        """
        aim = self.grasp.attractor(q)
        for number in range(CORRECTIONS + 1):
            self.body.rest_at(aim)
            remaining = np.zeros(len(q))
            remaining[self.motors] = (q - self.body.q)[self.motors]
            if np.abs(remaining).max() < ENOUGH or number == CORRECTIONS:
                break
            aim = np.clip(aim + remaining, *self.grasp.model.robot.limits.T)
        return aim

    def move(self, path: Array, speed: float, watch: BumpWatch | None = None) -> bool:
        """Move along a path (K, n) rad; return whether a bump (an unexpected collision) was detected.

        The attractor (the goal of the control law's spring) is shifted from the path such that the spring cancels the forces that
        `SideGrasp.forces` returns. `speed`: share of the largest speed. `watch`: detects bumps; at a bump the robot moves back a little and
        the motion ends; None: bumps are not detected.
        """
        return self.body.follow_path(path, speed, watch, self.grasp.forces).bumped

    def arrive(self, goal: PreGrasp, watch: BumpWatch | None = None) -> bool:
        """Settle at the posture `goal.away`, then move straight to the pre-grasp `goal`; return whether the hand bumped into something.

        `watch`: detects bumps; at a bump the robot moves back a little and the motion ends; None: bumps are not detected.
        """
        self.settle_at(goal.away)
        if self.move(np.stack([goal.away, goal.posture]), SLOW, watch):
            return True
        self.settle_at(goal.posture)
        self._there = goal.posture
        return False

    def close(self, thing: Upright, azimuth: float) -> None:
        """Move the palm from the pre-grasp to the thing, and close the hand.

        `azimuth`: direction that the palm faces [rad], see `azimuth_beside`. Raises NoPosture if the robot has no posture with the palm at
        the thing.
        """
        here = self._known(thing, azimuth, self.grasp.grip.gap, 0.0)
        there = self.body.q if self._there is None else self._there
        self.move(np.stack([there, here]), SLOW)
        self._passed = [there, here]
        aim, fingers = self.settle_at(here), self.grasp.hand.motors
        # The fingers arrive before the thumb, which pushes the thing into them.
        aim[fingers] = self.grasp.closed(here)[fingers]
        self.body.press(aim, CLOSING)
        self._fingers = self.grasp.squeezed(self.body.q)
        aim[fingers] = self._fingers
        self.body.press(aim, SQUEEZING)

    def lift(self, thing: Upright, azimuth: float) -> None:
        """Lift the thing straight up by 8 cm.

        `azimuth`: direction that the palm faces [rad], see `azimuth_beside`. Raises NoPosture if the robot has no posture for this.
        """
        up = self._held(self._known(thing, azimuth, self.grasp.grip.gap, LIFT))
        self.move(np.stack([self._held(self.body.q), up]), GENTLE)
        self._passed.append(up)

    def slipped(self, thing: Upright, centre: Array) -> Array:
        """Return how far a thing has slipped in the hand, (3,) m in the frame of the palm.

        This is the displacement of its centre from the place that the centre has when the hand closes around the thing. `thing`: as it was
        seen before the grasp. `centre`: (3,) m, root frame, where the cameras see the centre of the thing now.
        """
        pose, marker = self.grasp.model.evaluate(self.body.q), self.grasp.marker
        found: Array = pose.rotation(marker).T @ (centre - pose.position(marker)) - self._gripped(thing)
        return found

    def put(self, thing: Upright, places: Sequence[Array], centre: Array | None = None) -> Array:
        """Put the thing in the hand down at one of the places (2,) m, open the hand and retreat; return the place.

        It is the first of the places at which the control law's repulsive forces are small, or else the one with the smallest forces. If
        the hand or the thing bumps into something on the motion down, the hand moves up again and tries another place, at most 3 in all.

        Args:
            thing: the thing as it was seen before the grasp.
            places: (2,) m each, x and y in the root frame.
            centre: (3,) m, root frame, where the cameras see the centre of the thing now; None: it has not slipped in the hand.

        Raises:
            NoPosture: the thing could not be put down at any place. Then the hand has put it back where it was lifted, or, if there
                was a bump on this motion too, still holds it.
        """
        slipped = np.zeros(3) if centre is None else self.slipped(thing, centre)
        held = self._model_with(thing, slipped)
        bumps = 0
        while bumps < PUTS and (motion := self._motion_to(thing, places, slipped, held)) is not None:
            if self._set_down(motion):
                return motion.place
            bumps += 1
            places = [place for place in places if np.linalg.norm(place - motion.place) > BUMPED]
        before, there, up = self._passed
        is_back = self._set_down(_Motion(thing.place, np.stack([self._held(self.body.q), up, self._held(there)]), before))
        where = "it stands where it was lifted" if is_back else "it is still in the hand"
        raise NoPosture(f"no place to put the thing down, after {bumps} bumps: {where}")

    def _set_down(self, motion: _Motion) -> bool:
        """Move the thing to a place, open the hand and retreat; return False after a bump on the motion down, with the thing in the air."""
        self.move(motion.path[:2], GENTLE)
        up, down = motion.path[1:]
        near = up + NEAR * (down - up)
        if self.move(np.stack([up, near]), SLOW, BumpWatch(self.grasp.model.robot, self.watched)):
            self.move(np.stack([self._held(self.body.q), up]), GENTLE)
            return False
        self.move(np.stack([near, down]), SLOW)
        opened = self.grasp.opened(down)
        self.move(np.stack([down, opened]), FAST)
        self.move(np.stack([opened, motion.back]), SLOW)
        return True

    def _motion_to(self, thing: Upright, places: Sequence[Array], slipped: Array, held: Model) -> _Motion | None:
        """Return the motion that puts the thing down at one of `places`; None if no place has a motion without contacts.

        The control law pushes the robot away from obstacles. The first place is chosen at which this force is at most LITTLE_PUSH in the
        postures above and at the place, or else the place with the smallest force. `slipped`: (3,) m, how the thing has slipped in the
        hand, in the frame of the palm. `held`: model with the thing in the hand.
        """
        here, grasp = self.body.q, self.grasp
        best: tuple[float, _Motion] | None = None
        for place in places:
            azimuth = azimuth_beside(place)
            normal = np.array([-np.sin(azimuth), -np.cos(azimuth)])
            aside = slipped[0] * np.array([normal[1], -normal[0]]) + slipped[2] * normal
            there = Upright(place - aside, thing.radius, thing.height, thing.ground + max(slipped[1], 0.0))
            up = beside(grasp, there, azimuth, grasp.grip.gap, LIFT, here[None])
            down = None if up is None else beside(grasp, there, azimuth, grasp.grip.gap, ABOVE, up[None])
            back = None if down is None else beside(grasp, there, azimuth, RETREAT, ABOVE, down[None])
            if up is None or down is None or back is None:
                continue
            path, after = np.stack([self._held(q) for q in (here, up, down)]), np.stack([grasp.opened(down), back])
            push = max(LITTLE_PUSH, grasp.push(up), grasp.push(down))
            if best is not None and push >= best[0]:
                continue
            if is_free(held, path[:2]) and is_free(grasp.model, path) and is_free(grasp.model, after):
                best = push, _Motion(place, path, back)
                if push == LITTLE_PUSH:
                    break
        return None if best is None else best[1]

    def _gripped(self, thing: Upright) -> Array:
        """Return where the centre of a thing is in the frame of the palm when the hand closes around it, (3,) m."""
        grip = self.grasp.grip
        return np.array([grip.along, grip.height - 0.5 * thing.height, thing.radius + grip.gap])

    def _model_with(self, thing: Upright, slipped: Array) -> Model:
        """Return a model of the robot with the thing in its hand, a little enlarged, among what is around it."""
        model, marker, q = self.grasp.model, self.grasp.marker, self.body.q
        world, pose = World(), model.evaluate(q)
        for name, item in pose.objects.items():
            if item.role != "ghost":
                world.add(name, Geometry(item.kind, item.size), position=item.position, rotation=item.rotation)
        centre = pose.position(marker) + pose.rotation(marker) @ (self._gripped(thing) + slipped)
        world.add(CARRIED, cylinder(thing.radius, thing.height).grown(CLEAR), position=centre)
        found = Model(model.robot, world)
        for name, item in model.world.objects.items():
            if item.link is not None and name in world.objects:
                found.attach(name, item.link, q)
        found.attach(CARRIED, model.robot.links[model.robot.marker(marker).link], q)
        return found

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
    """Return whether a path (K, n) rad has no contacts of solids in the world of a model; its first posture is not checked.

    Postures about 0.03 rad apart are checked.
    """
    return not touches(model, path)


def touches(model: Model, path: Array) -> bool:
    """Return whether solids touch on a path (K, n) rad in the world of a model; its first posture is not checked.

    Postures about 0.03 rad apart are checked.
    """
    pieces = [path[:0]]
    for start, end in zip(path, path[1:], strict=False):
        count = max(1, int(np.ceil(np.abs(end - start).max() / STEP)))
        pieces.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return bool(np.any(model.evaluate(np.concatenate(pieces)).count))
