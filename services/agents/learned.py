"""Publishes what an agent has learned: rewards and values of its state-actions."""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import numpy as np

from bus_schema.messages import Learned, Surprise
from mobee import TransitionModel
from mobee.arrays import Array
from services.common.bus import Bus

PERIOD = 0.5  # s of the clock on the wall between two messages: in lockstep transitions come faster than anybody looks

MOST = 2000  # surprises in a message: more cannot be told apart in a picture


class LearnedStream:
    """Puts `Learned` after a transition, unless the last one is too recent."""

    def __init__(self, bus: Bus, model: TransitionModel) -> None:
        """`model`: of what the agent has observed."""
        self._model, self._part = model, model.space.part
        self._space = json.dumps(model.space.settings)
        self._stream = bus.publisher(Learned, self._part)
        self._next = -np.inf  # s, monotonic clock

    def put(self, n: int, s: int, numbers: Callable[[], tuple[Array, Array]]) -> None:
        """Tell, if it is time.  `n`, `s`: as in `Learned`; `numbers`: rewards and values (S, A)."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + PERIOD
        reward, value = numbers()
        self._stream.put(
            agent=self._part,
            n=n,
            s=s,
            space=self._space,
            tries=self._model.tries.astype("<u4").tobytes(),
            reward=reward.astype("<f4").tobytes(),
            value=value.astype("<f4").tobytes(),
            surprises=surprises(self._model),
        )


def surprises(model: TransitionModel) -> list[Surprise]:
    """The outcomes that were observed and are not the goals of their actions, with their shares of the tries; the likeliest of too many."""
    real = np.where(model.counts > 0.0, model.counts - model.imagined, 0.0)
    unexpected = (real > 0.0) & (model.outcomes != model.space.goals[:, :, None])
    share = real / np.maximum(real.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    found = np.argwhere(unexpected)
    if len(found) > MOST:
        found = found[np.sort(np.argsort(-share[unexpected], kind="stable")[:MOST])]
    return [Surprise(int(s), int(a), int(model.outcomes[s, a, b]), float(share[s, a, b])) for s, a, b in found]
