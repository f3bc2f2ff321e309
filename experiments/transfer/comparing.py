"""How far two records of the same agents are apart: total variation of what a state-action was seen to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mobee import Lattice
from mobee.robot.robot import Array, Ints

Counts = Mapping[str, Ints]  # by part: how often each outcome was seen, (S, A, S)


@dataclass(frozen=True, slots=True)
class Distance:
    """Between the outcomes of the state-actions that both have tried often enough."""

    variation: float
    """Mean total variation a state-action, 0 to 1."""
    agree: float
    """Share of the state-actions with the same most frequent outcome."""
    compared: int
    """How many state-actions there are."""


def counts_of(seen: Ints, space: Lattice) -> Ints:
    """How often each outcome was seen, (S, A, S), from rows (T, 3) of state, action and state reached."""
    counts = np.zeros((*space.goals.shape, len(space)), dtype=np.intp)
    np.add.at(counts, tuple(np.asarray(seen, dtype=np.intp).T), 1)
    return counts


def variations(first: Ints, second: Ints, least: int) -> Array:
    """The total variation (S, A) of two tables of counts (S, A, S); NaN where one has fewer than `least` tries."""
    both = (first.sum(axis=-1) >= least) & (second.sum(axis=-1) >= least)
    apart: Array = np.where(both, 0.5 * np.abs(shares(first) - shares(second)).sum(axis=-1), np.nan)
    return apart


def shares(counts: Ints) -> Array:
    """How often each outcome was seen among the tries of its state-action, (S, A, S); 0 where there are none."""
    found: Array = counts / np.maximum(counts.sum(axis=-1, keepdims=True), 1)
    return found


def distance(first: Counts, second: Counts, least: int) -> Distance:
    """Between two records of the same parts, over the state-actions of all of them."""
    apart = np.concatenate([variations(first[part], second[part], least).ravel() for part in first])
    same = np.concatenate([(first[part].argmax(axis=-1) == second[part].argmax(axis=-1)).ravel() for part in first])
    both = np.isfinite(apart)
    if not both.any():
        return Distance(float("nan"), float("nan"), 0)
    return Distance(float(apart[both].mean()), float(same[both].mean()), int(both.sum()))


def mean(distances: Sequence[Distance]) -> Distance:
    """Of several."""
    rows = np.array([(one.variation, one.agree, one.compared) for one in distances])
    variation, agree, compared = rows.mean(axis=0)
    return Distance(float(variation), float(agree), round(float(compared)))
