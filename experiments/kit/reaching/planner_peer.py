# SPDX-License-Identifier: Apache-2.0
"""The planner with which reach learners are compared: inverse kinematics and RRT-Connect, executed through MoBeE.

The planner has a belief about robot and world (`kit.reaching.belief`), which may differ from the plant, and it plans again after every
change.  If a motion does not end as planned, the planner plans again from the present pose of the arm, and avoids a pose near that in which
the motion ended.  A planner with a memory avoids this pose in later tries, too.  If the target was touched at the end of the motion, the
pose is avoided only for this target, else for all targets, as thesis 9.4.1 distinguishes workspace and body.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from experiments.kit.reaching.belief import NEAR, Care, PeerBelief, goals, rrt_connect, shortened
from experiments.kit.reaching.targets import GOOD
from mobee.arrays import Array
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachTarget
from mobee.robot.robot import Robot

Knowledge = tuple[list[Array], dict[bytes, list[Array]]]


class PeerMemory:
    """The poses of the motors, (d,) rad, that the planner avoids, because motions were blocked there or reaches missed.

    Poses in which the target was touched, or in which it was missed, are avoided only for this target; all other poses are always avoided
    (thesis 9.4.1).  `span`: (d,) rad, widths of the motors' ranges.
    """

    def __init__(self, span: Array) -> None:
        self._span = span
        self._always: list[Array] = []
        self._at_target: dict[bytes, list[Array]] = {}

    def __len__(self) -> int:
        return len(self._always) + sum(map(len, self._at_target.values()))

    def knowledge(self) -> Knowledge:
        """Return a copy of the content of the memory, which `restore` accepts."""
        return list(self._always), {place: list(poses) for place, poses in self._at_target.items()}

    def restore(self, knowledge: Knowledge) -> None:
        """Replace the content of the memory.  `knowledge`: the new content, as the method `knowledge` returned it."""
        self._always, self._at_target = list(knowledge[0]), {place: list(poses) for place, poses in knowledge[1].items()}

    def clear(self) -> None:
        """Forget all poses."""
        self.restore(([], {}))

    def blocked(self, aim: Array, end: Array, target: ReachTarget, touched: bool) -> None:
        """Record that a motion to the pose `aim` ended in another pose `end`, both (d,) rad; a pose near `end` is avoided from now on.

        The avoided pose lies on the line from `end` to `aim`, at the distance 0.08 from `end` in units of the motors' ranges; or it is
        `aim` if that is nearer.  `touched`: whether the target was touched; the pose is then avoided only for this target.
        """
        left = (aim - end) / self._span
        ahead = end + min(1.0, NEAR / max(float(np.linalg.norm(left)), 1e-9)) * (aim - end)
        if touched:
            self.missed(ahead, target)
        else:
            self._always.append(ahead)

    def missed(self, pose: Array, target: ReachTarget) -> None:
        """Record a pose (d,) rad that is to be avoided for this target only."""
        self._at_target.setdefault(place_of(target), []).append(pose)

    def of(self, target: ReachTarget) -> tuple[Array, Array]:
        """Return the poses to avoid for a target: all of them, (B, d) rad; and those that are avoided for this target only, (C, d) rad."""
        here = self._at_target.get(place_of(target), [])
        everything, alone = (np.array(poses).reshape(-1, len(self._span)) for poses in (self._always + here, here))
        return everything, alone


def place_of(target: ReachTarget) -> bytes:
    """Return a key of the target's position: targets at the same position have equal keys."""
    return target.position.tobytes()


MAX_GOALS = 8  # nearest goals that are planned to
ESCAPES = 64  # random poses, to get away from a contact


class PeerPlans:
    """Plans paths to targets with the planner's belief about robot and world.

    The goal poses of each target are kept; new ones are drawn if the avoided poses leave no path.  `seed`: seed of random goals and paths.
    """

    def __init__(self, belief: PeerBelief, seed: int) -> None:
        self._belief = belief
        self._rng = np.random.default_rng([seed, 86])
        self._goals: dict[bytes, tuple[Array, Array]] = {}

    def path(self, target: ReachTarget, here: Array, memory: PeerMemory) -> tuple[Array, Array] | None:
        """Return a path from the pose `here` (d,) rad to a target: its corners (k, d) rad, and the pose (d,) rad at the target.

        At the last corner the hand is still away from the target; from there it moves straight to the target.  If the poses that `memory`
        avoids leave no path, new goal poses are drawn.  If there is still no path, avoided poses are ignored: first those that are avoided
        for all targets, then the others.  Returns None if there is no path even then.
        """
        belief = self._belief
        belief.present(target)
        everything, of_target = memory.of(target)
        for number, remembered in enumerate((everything, everything, of_target, of_target[:0])):
            belief.blocked = remembered
            if number == 1 and len(remembered):
                self._goals.pop(place_of(target))
            found = self._search(target, here)
            if found is not None or not len(remembered):
                return found
        return None

    def _search(self, target: ReachTarget, here: Array) -> tuple[Array, Array] | None:
        belief, key = self._belief, place_of(target)
        if key not in self._goals:
            self._goals[key] = goals(belief, target, self._rng)
        poses, befores = self._goals[key]
        free = np.flatnonzero(belief.sound(poses, "grasping") & belief.sound(befores)) if len(poses) else np.array([], dtype=np.intp)
        if not len(free):
            return None
        near = free[np.argsort(np.linalg.norm((befores[free] - here) / belief.span, axis=1))[:MAX_GOALS]]
        start, escape = here, np.zeros((0, len(here)))
        if not belief.sound(here[None])[0]:
            start = self._escape(here)
            escape = start[None]
        path = self._path(start, befores[near])
        if path is None:
            return None
        chosen = near[int(np.argmin(np.abs(befores[near] - path[-1]).max(axis=1)))]
        return np.concatenate([escape, path[1:]]) if len(path) > 1 or len(escape) else path, poses[chosen]

    def _path(self, start: Array, ends: Array) -> Array | None:
        """Return the waypoints (k, d) rad of a path from `start` (d,) to one of the poses `ends` (G, d) rad, None if none was found.

        If neither `start` nor at least one of `ends` has a contact of the repulsive fields, a path without such contacts to such an end is
        tried first.  Otherwise, or if none is found, only contacts of solids are avoided.
        """
        belief = self._belief
        clear = ends[belief.sound(ends, "fields")]
        cares: tuple[Care, ...] = ("fields", "solids") if len(clear) and belief.sound(start[None], "fields")[0] else ("solids",)
        for care in cares:
            path = rrt_connect(belief, start, clear if care == "fields" else ends, int(self._rng.integers(2**31)), care)
            if path is not None:
                return shortened(belief, path, self._rng, care)
        return None

    def _escape(self, here: Array) -> Array:
        """Return the sound pose (d,) rad nearest to the pose `here` among random poses around it; `here` itself if none is found.

        `PeerBelief` defines "sound".  The random poses are drawn around `here` with a standard deviation of 5, 10, 20 and 40 % of the
        motors' ranges, in this order, until some of them are sound.  Distances are in units of the motors' ranges.
        """
        belief = self._belief
        for width in (0.05, 0.1, 0.2, 0.4):
            drawn = np.clip(here + width * belief.span * self._rng.normal(size=(ESCAPES, len(here))), *belief.range.T)
            drawn = drawn[belief.sound(drawn)]
            if len(drawn):
                nearest: Array = drawn[np.argmin(np.linalg.norm((drawn - here) / belief.span, axis=1))]
                return nearest
        return here


BLOCKED_OFFSET = 0.05  # of a motor's range: a motion that ends farther from its aim was blocked
MAX_ACTIONS = 20  # per try
Memory = Literal["none", "blocked", "missed"]
MEMORIES: tuple[Memory, ...] = ("none", "blocked", "missed")
Ended = Literal["there", "used up", "no plan"]
ENDS: tuple[Ended, ...] = ("there", "used up", "no plan")


@dataclass(frozen=True, slots=True)
class PeerTry:
    """The result of one attempt of the planner to bring the marker (a named point on the hand) to a target.

    `missing`: true distance of the marker from the target [m], as `PeerPlant.missing` returns it.  It is measured after the last motion to
    a pose at the target.  If there was no such motion, it is measured at the end of the attempt.  `ended`: "there": the planner believes
    the marker at the target; "no plan": it found no path; "used up": it made the largest number of actions, because motions were blocked or
    the target moved.  `actions`: number of motions.  `plans`: number of searches for a path.  `seconds`: duration in time of the plant [s].
    `planning`: processor time of the searches [s].  `checked`: number of poses checked for contacts.
    """

    missing: float
    ended: Ended
    actions: int
    plans: int
    seconds: float
    planning: float
    checked: int


class PeerPlant(Protocol):
    """The interface of the plant that the planner moves."""

    @property
    def robot(self) -> Robot:
        """The robot of the plant."""
        ...

    @property
    def time(self) -> float:
        """The time of the plant, s."""
        ...

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the part's motors, (n_part,) rad."""
        ...

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """Set the attractor of the part (the posture to which it moves) to `target` (n_part,) rad and wait until it settles or times out.

        Meanwhile the presented target exerts no force on the hand with the marker `marker`.  Returns how the motion ended.
        """
        ...

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world, or move the target that is there already; None removes it (see `mobee.reach.ReachPlant`)."""
        ...

    def missing(self, marker: str) -> float:
        """Return the true distance of the marker from the target now [m].

        It is measured from the target's centre, or from its surface if the target's `aim` is "surface" (0 inside the target).  `marker`:
        name of the marker, a point on the hand.
        """
        ...


class PlannerPeer:
    """Brings a marker (a named point on the hand) to targets by planning, one target after the other, each from the present pose.

    Args:
        plant: the plant that moves; motors that take no part in the planning keep their initial position.
        belief: the model of robot and world with which paths are planned; it may differ from the plant.
        part: name of the part of the motors.
        memory: what is kept from earlier attempts: "none": nothing; "blocked": where motions were blocked; "missed": also which poses
            missed their target although nothing blocked the motion.
        seed: of random goals and paths.
        limit: largest number of actions (motions) per attempt.
    """

    def __init__(
        self, plant: PeerPlant, belief: PeerBelief, part: str, memory: Memory = "none", seed: int = 0, limit: int = MAX_ACTIONS
    ) -> None:
        self._plant, self._belief, self._part, self._memory, self._limit = plant, belief, part, memory, limit
        self._columns = belief.columns - plant.robot.part(part).start
        self._rest = plant.measure(part)
        self._routes, self._known = PeerPlans(belief, seed), PeerMemory(belief.span)
        self._touched: tuple[str, ...] = ()
        self._actions = self._plans = 0
        self._planning = 0.0

    @property
    def remembered(self) -> int:
        """The number of poses that the planner avoids, for one target or for all targets."""
        return len(self._known)

    def knowledge(self) -> Knowledge:
        """Return a copy of the content of the memory, which `restore` accepts."""
        return self._known.knowledge()

    def restore(self, knowledge: Knowledge) -> None:
        """Replace the content of the memory.  `knowledge`: the new content, as the method `knowledge` returned it."""
        self._known.restore(knowledge)

    def try_problem(self, target: ReachTarget, sees: Callable[[], ReachTarget] | None = None) -> PeerTry:
        """Present a target, move the marker to it, and then away from it again; returns the result.

        After each motion to a pose at the target, the arm returns to the last waypoint of the path, at which the hand is away from it.

        `sees`: function that returns the target as it is seen now.  It is called before each plan, before each motion to a waypoint, and
        after each motion to a pose at the target.  None: the target does not move.
        """
        if self._memory == "none":
            self._known.clear()
        before = self._counts()
        self._plant.present(target)
        missing, ended = self._approach(sees or (lambda: target))
        actions, plans, seconds, planning, checked = (now - then for now, then in zip(self._counts(), before, strict=True))
        return PeerTry(missing, ended, int(actions), int(plans), seconds, planning, int(checked))

    def _counts(self) -> tuple[float, ...]:
        return self._actions, self._plans, self._plant.time, self._planning, self._belief.checked

    def _approach(self, sees: Callable[[], ReachTarget]) -> tuple[float, Ended]:
        """Plan and move until the marker is believed to be at the target, no action is left or no plan is found.

        Returns the true remaining error [m] and the reason of the end, as in the fields `missing` and `ended` of `PeerTry`.  `sees`:
        function that returns the target as it is seen now.
        """
        missing, stop, ended = np.inf, self._actions + self._limit, ENDS[1]
        while self._actions < stop:
            seen = sees()
            plan = self._plan(seen)
            if plan is None:
                ended = ENDS[2]
                break
            corners, pose = plan
            if not self._follow(corners, seen, sees, stop):
                continue
            end = self._go(pose)
            missing = self._plant.missing(self._belief.marker)
            believed = sees().missing(self._belief.model.evaluate(self._belief.whole(end)).position(self._belief.marker))
            if believed > GOOD:
                self._note(pose, end, seen)
            elif missing > GOOD and self._memory == "missed":
                self._known.missed(pose, seen)
            self._go(corners[-1])
            if believed <= GOOD:
                return missing, ENDS[0]
        return (missing if missing < np.inf else self._plant.missing(self._belief.marker)), ended

    def _follow(self, corners: Array, seen: ReachTarget, sees: Callable[[], ReachTarget], stop: int) -> bool:
        """Go along the corners; returns False when a motion is blocked, the target has moved or the actions are used up."""
        for corner in corners:
            if place_of(sees()) != place_of(seen) or self._actions >= stop:
                return False
            end = self._go(corner)
            if self._off(end, corner):
                self._note(corner, end, seen)
                return False
        return True

    def _plan(self, target: ReachTarget) -> tuple[Array, Array] | None:
        begun = time.process_time()
        found = self._routes.path(target, self._here, self._known)
        self._plans, self._planning = self._plans + 1, self._planning + time.process_time() - begun
        return found

    def _go(self, q: Array) -> Array:
        """Make one action; returns the reached positions of the motors, (d,) rad."""
        whole = self._rest.copy()
        whole[self._columns] = np.clip(q, *self._belief.range.T)
        outcome = self._plant.go(self._part, whole, self._belief.marker)
        self._actions += 1
        self._touched = outcome.touched
        end: Array = outcome.q[self._columns]
        return end

    def _note(self, aim: Array, end: Array, target: ReachTarget) -> None:
        self._known.blocked(aim, end, target, TARGET in self._touched)

    @property
    def _here(self) -> Array:
        here: Array = self._plant.measure(self._part)[self._columns]
        return here

    def _off(self, end: Array, aim: Array) -> bool:
        return bool((np.abs(end - aim) / self._belief.span).max() > BLOCKED_OFFSET)
