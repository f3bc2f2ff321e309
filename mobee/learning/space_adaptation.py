"""State spaces adapted to what was learned: without unreachable states, with shortcuts (thesis 9.4.5)."""

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

SEEN = 5  # so often a state must have been aimed at, and never been come to, to be held for unreachable
SPAN = 4  # transitions, within which two states are on one way


def pruned(space: Space, transitions: Sequence[Transition], seen: int = SEEN) -> tuple[Space, Ints]:
    """The space without states that were aimed at `seen` times and never come to, and the new number of every state, -1 if it is gone.

    Raises InvalidValue if less than two states would be left.
    """
    aimed, reached = np.zeros(len(space), dtype=int), np.zeros(len(space), dtype=bool)
    for made in transitions:
        aimed[space.goal(made.s, made.a)] += 1
        reached[[made.s, made.s_next]] = True
    kept = reached | (aimed < seen)
    edges = edges_of(space.goals)
    while True:  # who has lost all that it leads to, goes too
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


def with_shortcuts(space: Space, transitions: Sequence[Transition], count: int, span: int = SPAN) -> Space:
    """The space with actions between the pairs of states, not neighbours yet, that were most often passed one soon after the other.

    `count`: how many pairs, joined both ways; `span`: transitions from the one to the other, at most.
    """
    known = set(edges_of(space.goals))
    way: list[int] = []
    passed: Counter[tuple[int, int]] = Counter()
    for made in transitions:
        if not way or way[-1] != made.s:
            way = [made.s]
        if made.s_next in way:
            way = way[: way.index(made.s_next)]  # a loop leads nowhere
        way = [*way[-span:], made.s_next]
        passed.update((min(one, way[-1]), max(one, way[-1])) for one in way[:-2] if (one, way[-1]) not in known)
    best = sorted(passed, key=lambda pair: (-passed[pair], pair))[:count]
    edges = joined([*known, *best, *((goal, state) for state, goal in best)])
    return Space(space.robot, space.joints, space.samples, table_of(edges, len(space)), space.rest)


def carried(transitions: Sequence[Transition], old: Space, new: Space) -> list[Transition]:
    """Transitions of one space as those of another over the same joints, where it has their states and action; numbered anew.

    States are found by their samples; where a transition ended, by where the part came to rest.
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
