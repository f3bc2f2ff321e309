"""Random numbers that follow from a seed, a name and a count: who draws again at the same count draws the same."""

from __future__ import annotations

import hashlib

import numpy as np


class Draws:
    """One generator that is set anew for every count, which takes a tenth of the time of making one.

    `name`: tells apart who draws under the same seed.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._bits = np.random.PCG64(0)
        self._generator = np.random.Generator(self._bits)

    def at(self, seed: int, count: int) -> np.random.Generator:
        """The generator at the beginning of the draws of a count; valid until the next call."""
        drawn = hashlib.blake2b(f"{self._name} {seed} {count}".encode(), digest_size=32).digest()
        state, stream = int.from_bytes(drawn[:16], "little"), int.from_bytes(drawn[16:], "little") | 1
        self._bits.state = {"bit_generator": "PCG64", "state": {"state": state, "inc": stream}, "has_uint32": 0, "uinteger": 0}
        return self._generator
