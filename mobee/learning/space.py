# SPDX-License-Identifier: Apache-2.0
"""The state-action space of one part: states are the Voronoi cells of samples, and actions aim at samples (thesis 6.2, 6.3).

`Space` has given samples and goals. `Voronoi` draws its samples at random, and its actions aim at the nearest samples. `pruned` and
`with_shortcuts` adapt a space to observed transitions: the first removes unreachable states, the second adds shortcuts, which are actions
between states that often followed each other within a few transitions (thesis 9.4.5).
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints, checked_seed, real_array
from mobee.errors import InvalidValue
from mobee.learning.neighbours import NO_ACTION, edges_of, joined, nearest_finder, nearest_goals, table_of
from mobee.plant import Outcome
from mobee.robot.robot import Part, Robot

if TYPE_CHECKING:
    from mobee.store import Transition

MAX_STATES = 100_000  # a larger space takes too long to explore on a robot (thesis 7.4)
NEIGHBOURS = 16  # of each state, as in the thesis' arms
MIN_ATTEMPTS = 5  # actions towards a state that was never reached, after which it counts as unreachable
SHORTCUT_SPAN = 4  # transitions on a path between the two states of a shortcut, at most


class Space:
    """States and actions of one part, given by their samples and goals; `Lattice` and `Voronoi` compute samples and goals.

    A state is the set of poses that are nearer to its sample than to any other sample, in fractions of the joint ranges (a Voronoi cell).
    Each action of a state aims at the sample of another state, its goal; the number of the action is its index among the goals of the
    state. In shapes, S is the number of states, A the largest number of actions of a state, d the number of joints, and n_part the number
    of motors of the part.

    Args:
        robot: the robot.
        joints: motor names, all of one part.
        samples: (S, d) rad, a pose of the joints for each state.
        goals: (S, A) the state at which each action aims; rows of states with fewer actions end in -1.
        rest: fraction of its range at which each other motor of the part stays; or a list with one fraction for each motor of the part.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    only_postures = True
    """Whether a state is determined by the posture of the part alone, and an action by its goal state."""

    def __init__(
        self, robot: Robot, joints: Sequence[str], samples: ArrayLike, goals: ArrayLike, rest: float | Sequence[float] = 0.5
    ) -> None:
        part, indices = checked_joints(robot, joints)
        rests = real_array("rest", rest)
        if rests.shape not in ((), (len(part),)) or not ((rests >= 0.0) & (rests <= 1.0)).all():
            raise InvalidValue(
                f"rest={rest!r}: give the fraction of their range, 0 to 1, at which the part's other motors stay, or one for each of its "
                f"{len(part)} motors."
            )
        self.robot, self.part, self.joints = robot, part.name, tuple(joints)
        self.rest: float | list[float] = rests.tolist()
        self.columns: Ints = indices - part.start
        """Indices of the joints among the motors of the part, shape (d,)."""
        self._columns: list[int] = self.columns.tolist()
        self.samples: Array = _checked_samples(samples, len(joints))
        """The sample of each state, shape (S, d), in [rad]."""
        self.goals: Ints = _checked_goals(goals, len(self.samples))
        """Goal state of every action, shape (S, A), -1 where a state has no such action."""
        self._counts: list[int] = (self.goals != NO_ACTION).sum(axis=1).tolist()
        self._low, self._spans = robot.limits[indices, 0], np.ptp(robot.limits[indices], axis=1)
        low, high = robot.limits[part.slice].T
        self._targets = np.tile(low + rests * (high - low), (len(self.samples), 1))
        self._targets[:, self.columns] = self.samples
        for array in (self.samples, self.goals, self.columns):
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.samples)

    def __repr__(self) -> str:
        kind = type(self).__name__
        return f"<{kind} of {self.part}: {len(self)} states, {self.state_actions} state-actions>"

    @property
    def state_actions(self) -> int:
        """The number of state-actions: the sum of the numbers of actions of all states."""
        return sum(self._counts)

    def actions(self, state: int) -> Ints:
        """Return the goal states of the actions of a state, shape (actions,): action a aims at the a-th of them.

        They are in ascending order, unless the table `goals` was given in another order. Raises InvalidValue if there is no such state.
        """
        row: Ints = self.goals[self._checked_state(state), : self._counts[state]]
        return row

    def goal(self, state: int, action: int) -> int:
        """Return the goal state of an action: the state at whose sample it aims. Raises InvalidValue if there is no such action."""
        count = self._counts[self._checked_state(state)]
        if not (isinstance(action, (int, np.integer)) and 0 <= action < count):
            raise InvalidValue(f"state {state} of {self.part} has no action {action!r}: valid are 0 to {count - 1}.")
        return self.goals.item(state, action)

    def state_of(self, q: ArrayLike) -> int:
        """Return the state whose sample is nearest to a pose of the part, with distances in fractions of the joint ranges.

        `q`: rad, shape (n_part,): positions of all motors of the part, as a plant measures them. If the space has fewer joints than the
        part has motors, `q` may also be the positions of these joints alone, shape (d,), in the order of `joints`. If several samples are
        equally near, a `Lattice` returns the lowest state number; for other spaces it may be any of them. Raises InvalidValue for another
        shape or values that are not finite.
        """
        given = real_array(f"q of {self.part}", q)
        if given.shape == self._targets.shape[1:]:
            values = given.tolist()
            return self._state_of([values[column] for column in self._columns])
        return self.state_of_joints(given)

    def state_of_joints(self, q: ArrayLike) -> int:
        """Return the state whose sample is nearest to a pose of the space's joints alone, shape (d,) rad, in the order of `joints`.

        Distances are in fractions of the joint ranges. Raises InvalidValue for another shape or values that are not finite.
        """
        given = real_array(f"q of {self.part}", q)
        if given.shape != self.columns.shape:
            raise InvalidValue(
                f"q has shape {given.shape}: give the {len(self.joints)} joints ({', '.join(self.joints)}) "
                f"or all {self._targets.shape[1]} motors of {self.part}, in rad."
            )
        return self._state_of(given.tolist())

    def state_after(self, outcome: Outcome, before: int | None = None) -> int:
        """Return the state in which an action ended, that of `outcome.q`.

        `before`: the state in which the action began; this class does not use it, but `ObjectSpace` does.
        """
        return self.state_of(outcome.q)

    def target(self, state: int) -> Array:
        """Return the sample of a state as a pose of the whole part, shape (n_part,), in [rad].

        Motors that are not joints of the space are at `rest`. Raises InvalidValue if there is no such state.
        """
        pose: Array = self._targets[self._checked_state(state)].copy()
        return pose

    def aim(self, state: int, action: int) -> Array:
        """Return the pose of the part at which an action aims, shape (n_part,), in [rad]: the sample of its goal state, see `target`."""
        return self.target(self.goal(state, action))

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments and a hash of the space, as JSON values.

        `mobee.learning.record.space_from` rebuilds the space from them.
        """
        return self._made | {"kind": "space", "samples": self.samples.tolist(), "goals": self.goals.tolist()}

    @cached_property
    def _made(self) -> dict[str, Any]:
        """The settings that all kinds of spaces have."""
        content = np.round(self.samples, 6).tobytes() + self.goals.astype("<i8").tobytes()
        digest = hashlib.sha256(content).hexdigest()[:16]
        return {"robot": self.robot.name, "joints": list(self.joints), "rest": self.rest, "digest": digest}

    def _state_of(self, q: list[float]) -> int:
        if not isfinite(sum(q)):  # a list: NumPy is slower for so few numbers
            raise InvalidValue(f"q of {self.part} is not finite: {q}.")
        return self._cell(q)

    def _cell(self, q: list[float]) -> int:
        """Return the state of a pose of the joints, one number each, in [rad]."""
        return self._nearest((np.array(q) - self._low) / self._spans)

    @cached_property
    def _nearest(self) -> Callable[[Array], int]:
        return nearest_finder((self.samples - self._low) / self._spans)

    def _checked_state(self, state: int) -> int:
        if not (isinstance(state, (int, np.integer)) and 0 <= state < len(self._counts)):
            raise InvalidValue(f"{self.part} has no state {state!r}: valid are 0 to {len(self._counts) - 1}.")
        return state


class Voronoi(Space):
    """A space whose samples are drawn at random, or given; actions aim at the nearest samples.

    A state is the Voronoi cell of its sample. Distances are in fractions of the joint ranges. To make thousands of states takes seconds;
    memory grows in proportion to their number.

    Args:
        robot: the robot; samples are drawn within its motor limits.
        joints: motor names, all of one part.
        samples: number of samples to draw uniformly in the joint ranges, or the samples themselves, shape (S, d), in [rad].
        seed: seed of the random samples; ignored if the samples are given.
        neighbours: number of nearest samples to which each state has actions. None: 16, or all others if there are fewer.
        tie_seed: if several samples are equally near, but not all of them become neighbours, a random choice with this seed decides.
        rest: fraction of its range at which each other motor of the part stays.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[str],
        samples: int | ArrayLike,
        seed: int = 0,
        neighbours: int | None = None,
        tie_seed: int = 0,
        rest: float = 0.5,
    ) -> None:
        _, indices = checked_joints(robot, joints)
        limits = robot.limits[indices]
        seed, tie_seed, drawn = checked_seed(seed), checked_seed(tie_seed), isinstance(samples, (int, np.integer))
        poses = _drawn_samples(samples, limits, seed) if drawn else _checked_within(samples, limits, joints)
        self.seed, self.tie_seed = seed if drawn else None, tie_seed
        self.neighbours = checked_neighbours(neighbours, len(poses))
        goals: Ints = nearest_goals((poses - limits[:, 0]) / np.ptp(limits, axis=1), self.neighbours, tie_seed)
        super().__init__(robot, joints, poses, goals, rest)

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments and a hash of the space, as JSON values.

        `mobee.learning.record.space_from` rebuilds the space from them.
        """
        samples = len(self) if self.seed is not None else self.samples.tolist()
        made = {"samples": samples, "seed": self.seed, "neighbours": self.neighbours, "tie_seed": self.tie_seed}
        return self._made | made | {"kind": "voronoi"}


def pruned(space: Space, transitions: Sequence[Transition], seen: int = MIN_ATTEMPTS) -> tuple[Space, Ints]:
    """Return the space without unreachable states, and the new number of each state, (S,), -1 for a removed state.

    A state is unreachable if it was the goal of at least `seen` of the transitions, and no transition started or ended in it. States whose
    actions all lead to removed states are removed too. Raises InvalidValue if fewer than two states would remain, or for a space whose
    states are not poses alone.
    """
    _require_poses(space)
    aimed, reached = np.zeros(len(space), dtype=int), np.zeros(len(space), dtype=bool)
    for made in transitions:
        aimed[space.goal(made.s, made.a)] += 1
        reached[[made.s, made.s_next]] = True
    kept = reached | (aimed < seen)
    edges = edges_of(space.goals)
    while True:  # a state without actions is removed, too
        left = [(s, g) for s, g in edges if kept[s] and kept[g]]
        out = np.zeros(len(space), dtype=bool)
        out[[s for s, _ in left]] = True
        if (kept == (kept & out)).all():
            break
        kept &= out
    if kept.sum() < 2:
        raise InvalidValue(f"of {len(space)} states {kept.sum()} were reached: observe more before pruning.")
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    table = table_of([(int(number[s]), int(number[g])) for s, g in left], int(kept.sum()))
    return Space(space.robot, space.joints, space.samples[kept], table, space.rest), number


def with_shortcuts(space: Space, transitions: Sequence[Transition], count: int, span: int = SHORTCUT_SPAN) -> Space:
    """Return a space with more actions: shortcuts between states that often followed each other within a few transitions.

    `transitions`: the transitions of an agent, in order; consecutive ones form a path, from which loops are removed. `count`: number of
    pairs of states that get a shortcut in both directions: the pairs that occurred most often on the path and have no action yet. `span`:
    largest number of transitions on the path between the two states of a pair. Raises InvalidValue for a space whose states are not poses
    alone.
    """
    _require_poses(space)
    known = set(edges_of(space.goals))
    path: list[int] = []
    passed: Counter[tuple[int, int]] = Counter()
    for made in transitions:
        if not path or path[-1] != made.s:
            path = [made.s]
        if made.s_next in path:
            path = path[: path.index(made.s_next)]  # without the loop
        path = [*path[-span:], made.s_next]
        passed.update((min(one, path[-1]), max(one, path[-1])) for one in path[:-2] if (one, path[-1]) not in known)
    best = sorted(passed, key=lambda pair: (-passed[pair], pair))[:count]
    edges = joined([*known, *best, *((goal, state) for state, goal in best)])
    return Space(space.robot, space.joints, space.samples, table_of(edges, len(space)), space.rest)


def _require_poses(space: Space) -> None:
    """Raise InvalidValue for an `ObjectSpace` or a `DiscreteSpace`: a `Space` has only samples and goals, and would lose the rest."""
    if not space.only_postures:
        raise InvalidValue(f"{space}: its states are not poses alone, so it cannot be adapted; of an ObjectSpace give `space.postures`.")


def carried(transitions: Sequence[Transition], old: Space, new: Space) -> list[Transition]:
    """Convert transitions of the space `old` to the space `new`, which must have the same joints; return the converted transitions.

    Start and goal of a transition become the states of `new` with the same samples. A transition is left out if `new` lacks one of these
    states, or has no action from the start to the goal. The end of a transition becomes the state of `new` that contains the pose recorded
    there. The transitions are numbered again from 1.
    """
    same = {state: new.state_of_joints(sample) for state, sample in enumerate(old.samples)}
    same = {before: now for before, now in same.items() if np.array_equal(old.samples[before], new.samples[now])}
    found: list[Transition] = []
    for made in transitions:
        state, goal = same.get(made.s), same.get(old.goal(made.s, made.a))
        row = [] if state is None else new.actions(state).tolist()
        if state is not None and goal in row:
            ended = new.state_of(made.q)
            found.append(replace(made, n=len(found) + 1, s=state, a=row.index(goal), s_next=ended))
    return found


def checked_joints(robot: Robot, joints: Sequence[str]) -> tuple[Part, Ints]:
    """Return the part (group of motors) of `joints`, which are names of motors, and their indices among the robot's motors, (d,).

    Raises UnknownName, and InvalidValue unless all joints belong to one part, can move, and are given once.
    """
    if isinstance(joints, str) or len(joints) == 0:
        raise InvalidValue(f"joints={joints!r}: give a list of motor names of one part, e.g. {list(robot.motors[:2])}.")
    if len(set(joints)) < len(joints):
        raise InvalidValue(f"joints={list(joints)} names a motor twice.")
    indices = np.array([robot.motor_index(name) for name in joints], dtype=np.intp)
    parts = sorted({robot.motor_table[i].part for i in indices})
    if len(parts) > 1:
        raise InvalidValue(f"joints={list(joints)} lie in several parts ({', '.join(parts)}): make one lattice, and one agent, a part.")
    for name, (low, high) in zip(joints, robot.limits[indices], strict=True):
        if not low < high:
            raise InvalidValue(f"motor {name!r} of {robot.name} cannot move (limits {low} to {high} rad): leave it out of the lattice.")
    return robot.part(parts[0]), indices


def checked_neighbours(neighbours: object, states: int, also: str = "") -> int:
    """Return the number of neighbours of each state: the given one; for None 16, or all other states if there are fewer.

    `states`: number of states. `also`: text about further valid values, for the error message. Raises InvalidValue unless `neighbours` is
    None or a whole number from 1 to `states` - 1.
    """
    if neighbours is None:
        return min(NEIGHBOURS, states - 1)
    if isinstance(neighbours, bool) or not isinstance(neighbours, int | np.integer) or not 1 <= neighbours < states:
        raise InvalidValue(f"neighbours={neighbours!r}: give a whole number from 1 to {states - 1}{also}.")
    return int(neighbours)


def _checked_samples(samples: ArrayLike, joints: int) -> Array:
    given = real_array("samples", samples)
    if given.ndim != 2 or given.shape[1] != joints or len(given) < 2 or not np.isfinite(given).all():
        raise InvalidValue(
            f"samples have shape {given.shape}: give at least two finite poses of the {joints} joints, shape (S, {joints}), in rad."
        )
    return given


def _checked_goals(goals: ArrayLike, states: int) -> Ints:
    table = real_array("goals", goals)
    given = table.astype(np.intp)
    if given.ndim != 2 or len(given) != states or not ((table == given) & (given >= NO_ACTION) & (given < states)).all():
        raise InvalidValue(
            f"goals have shape {given.shape}: give one row of states 0 to {states - 1} for each of the {states} states, -1 at the end."
        )
    if (np.diff((given == NO_ACTION).astype(np.int8), axis=1) < 0).any() or (given[:, 0] == NO_ACTION).any():
        raise InvalidValue("goals: give each state at least one action, and -1 only after its last one.")
    return given


def _drawn_samples(samples: Any, limits: Array, seed: int) -> Array:
    if isinstance(samples, bool) or not 2 <= samples <= MAX_STATES:
        raise InvalidValue(
            f"samples={samples!r}: give how many to draw, 2 to {MAX_STATES}, or an array of poses (S, {len(limits)}) in rad."
        )
    low, high = limits.T
    return np.random.default_rng(seed).uniform(low, high, size=(samples, len(limits)))


def _checked_within(samples: ArrayLike, limits: Array, joints: Sequence[str]) -> Array:
    given = real_array("samples", samples)
    if given.ndim != 2 or given.shape[1] != len(joints) or not 2 <= len(given) <= MAX_STATES:
        raise InvalidValue(
            f"samples have shape {given.shape}: give 2 to {MAX_STATES} poses of {', '.join(joints)}, shape (S, {len(joints)}), in rad."
        )
    outside = ~((given >= limits[:, 0]) & (given <= limits[:, 1]))
    if outside.any():
        sample, joint = np.argwhere(outside)[0]
        low, high = limits[joint]
        raise InvalidValue(f"sample {sample} has {joints[joint]} at {given[sample, joint]}: valid is {low:.4g} to {high:.4g} rad.")
    if len(np.unique(given, axis=0)) < len(given):
        raise InvalidValue("samples: two are the same pose, so one of them would have no cell; leave one out.")
    return given
