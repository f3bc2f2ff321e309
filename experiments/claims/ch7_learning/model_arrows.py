"""A drawing of the transition model of an arm as in fig. 7 of the paper: four dimensions in two, an arrow a probability."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mobee import Lattice
from mobee.arrays import Array, Ints
from mobee.learning.neighbours import NO_ACTION

GAP = 4.6  # between blocks of states, in units of the distance inside
COLOURED, SHOWN = 0.3, 0.08  # a state-action is coloured when an unforeseen state is that likely; its arrows begin there
LABELS = ("123", "abc", ("I", "II", "III"), "ABC")  # of the levels of pitch, roll, yaw and elbow, as in the paper


def draw_arrows(axes: Any, space: Lattice, outcomes: Ints, probabilities: Array) -> None:
    """Draw a rank 3 arm; outcomes and probabilities (S, A, B).

    Pitch and elbow within a block, roll and yaw from block to block.  Gray: what goes where it aims, or stays; each colour: one
    state-action that leads to a state it does not aim at.
    """
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.patches import FancyArrowPatch

    places = _places(len(space))
    states, actions = np.nonzero(space.goals != NO_ACTION)
    goals = space.goals[states, actions]
    axes.add_collection(
        LineCollection(list(np.stack([places[states], places[goals]], axis=1)), colors="0.5", linewidths=0.3, alpha=0.18, zorder=1)
    )
    colors = colormaps["turbo"]
    coloured = list(_unforeseen(space, outcomes, probabilities))
    for number, (state, action) in enumerate(coloured):
        color = colors((number * 0.618) % 1.0)  # neighbours in the list get far colours
        for outcome, probability in zip(outcomes[state, action], probabilities[state, action], strict=True):
            if probability >= SHOWN and outcome != state:
                arrow = FancyArrowPatch(
                    places[state],
                    places[outcome],
                    connectionstyle="arc3,rad=0.15",
                    arrowstyle="-|>",
                    mutation_scale=4.0 + 5.0 * probability,
                    linewidth=2.0 * probability,
                    color=color,
                    shrinkA=2.0,
                    shrinkB=2.0,
                    zorder=3,
                )
                axes.add_patch(arrow)
    axes.plot(*places.T, "o", color="0.2", markersize=2.2, zorder=2)
    _label(axes, places)
    axes.set(xlim=(-1.3, 2.0 * GAP + 3.0), ylim=(-1.6, 2.0 * GAP + 2.6))
    axes.set_axis_off()
    axes.text(GAP + 1.0, -1.55, f"{len(coloured)} coloured of {len(states)} state-actions", ha="center", fontsize=8)


def _unforeseen(space: Lattice, outcomes: Ints, probabilities: Array) -> Iterator[tuple[int, int]]:
    """State-actions with a likely outcome that is neither their goal nor where they start."""
    for state in range(len(space)):
        for action, goal in enumerate(space.actions(state)):
            other = (outcomes[state, action] != goal) & (outcomes[state, action] != state)
            if probabilities[state, action][other].max(initial=0.0) >= COLOURED:
                yield state, action


def _places(count: int) -> Array:
    """(S, 2): pitch and roll to the right, elbow and yaw up; a little askew, so that arrows along a line do not cover each other."""
    pitch, roll, yaw, elbow = (np.arange(count)[:, None] // 3 ** np.arange(4) % 3).T
    x = GAP * roll + pitch + 0.18 * (elbow - 1)
    y = GAP * yaw + elbow + 0.18 * (pitch - 1)
    return np.stack([x, y], axis=1)


def _label(axes: Any, places: Array) -> None:
    for level in range(3):
        axes.text(GAP * level + 1.0, -1.1, f"roll {LABELS[1][level]}", ha="center", fontsize=8)
        axes.text(-0.9, GAP * level + 1.0, f"yaw {LABELS[2][level]}", ha="center", va="center", rotation=90, fontsize=8)
        axes.text(places[level, 0], places[level, 1] - 0.45, LABELS[0][level], ha="center", fontsize=6, color="0.4")
        axes.text(places[27 * level, 0] - 0.4, places[27 * level, 1], LABELS[3][level], va="center", fontsize=6, color="0.4")
