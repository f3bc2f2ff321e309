"""A (1+1) evolution strategy over the logarithms of the gains."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from experiments.control.models import icub
from experiments.tune.criteria import Judged, evaluate, objective
from mobee import Controller, Gains

# Motors with a spring of their own: those of the torso move the hands farthest, those of the shoulders elbows against the chest.
SPRINGS = {"max_spring of the torso": "torso_*", "max_spring of the shoulders": "?_shoulder_*"}
TUNED = (
    "damping",
    "stiffness",
    "max_spring",
    "max_limit",
    "max_constraint",
    "contact_gain",
    "max_contact",
    "max_client",
    *SPRINGS,
)
COLUMNS = (*TUNED, *Judged.columns())
CHANGED = (1, 3)  # numbers at a time, least and most
STEP, GROW, SHRINK = 0.3, 1.5, 0.9  # of the logarithms: standard deviation at first, after a success, after a failure

LEAST = 0.015  # s: sets that are not stable at such a control period are not judged


@dataclass(frozen=True, slots=True)
class Tried:
    """A gain set and what it was judged."""

    numbers: dict[str, float]
    judged: Judged

    @property
    def objective(self) -> float:
        """Less is better."""
        return objective(self.judged)

    def record(self) -> dict[str, object]:
        """For the file."""
        return {**{name: round(value, 6) for name, value in self.numbers.items()}, **self.judged.record()}

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Tried:
        """From the file."""
        return cls({name: float(row[name]) for name in TUNED}, Judged.of_record(row))


def search(tried: list[Tried], sets: int, seed: int) -> Iterator[Tried]:
    """Append to what is known until it is so many sets; what comes is decided by it and the seed."""
    while len(tried) < sets:
        numbers = _next(tried, seed) if tried else numbers_of(Gains.default())
        tried.append(Tried(numbers, evaluate(gains_with(numbers))))
        yield tried[-1]


def numbers_of(gains: Gains) -> dict[str, float]:
    """What is tuned."""
    motors = icub().robot.motors
    springs = gains.of_motors("max_spring", motors)
    numbers = {name: float(getattr(gains, name)) for name in TUNED if name not in SPRINGS}
    return numbers | {name: float(springs[[fnmatchcase(m, pattern) for m in motors]][0]) for name, pattern in SPRINGS.items()}


def gains_with(numbers: Mapping[str, float]) -> Gains:
    """`Gains.default()` but for these numbers."""
    common: dict[str, Any] = {name: value for name, value in numbers.items() if name not in SPRINGS}
    gains = replace(Gains.default(), motors=(), groups=(), **common)
    for name, pattern in SPRINGS.items():
        gains = gains.with_motors(pattern, max_spring=numbers[name])
    return gains


def _next(tried: list[Tried], seed: int) -> dict[str, float]:
    rng = np.random.default_rng([seed, len(tried)])
    step, best = STEP, tried[0]
    for one in tried[1:]:
        is_better = one.objective < best.objective
        step *= GROW if is_better else SHRINK
        best = one if is_better else best
    while True:
        numbers = _changed(best.numbers, step, rng)
        if Controller(icub(), gains_with(numbers)).max_dt > LEAST:
            return numbers


def _changed(numbers: dict[str, float], step: float, rng: np.random.Generator) -> dict[str, float]:
    chosen = rng.choice(TUNED, rng.integers(*CHANGED, endpoint=True), replace=False)
    return {name: value * (float(np.exp(step * rng.standard_normal())) if name in chosen else 1.0) for name, value in numbers.items()}
