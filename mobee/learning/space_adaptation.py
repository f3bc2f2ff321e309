# SPDX-License-Identifier: Apache-2.0
"""State spaces adapted to observed transitions: without unreachable states, with shortcuts (thesis 9.4.5)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mobee.arrays import Ints
from mobee.errors import InvalidValue
from mobee.learning.neighbours import edges_of, joined, table_of
from mobee.learning.space import Space
from mobee.store import Transition

MIN_ATTEMPTS = 5  # actions towards a state that was never reached, after which it counts as unreachable
SHORTCUT_SPAN = 4  # transitions on a path between the two states of a shortcut, at most


def pruned(space: Space, transitions: Sequence[Transition], seen: int = MIN_ATTEMPTS) -> tuple[Space, Ints]:
    """Return the space without unreachable states, and the new number of each state, (S,), -1 for a removed state.

    A state is unreachable if it was the goal of at least `seen` of the transitions, and no transition started or ended in it. States whose
    actions all lead to removed states are removed too. Raises InvalidValue if fewer than two states would remain.
    """
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
    largest number of transitions on the path between the two states of a pair.
    """
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
