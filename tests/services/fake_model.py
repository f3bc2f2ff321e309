# SPDX-License-Identifier: Apache-2.0
"""The model as a test plays it."""

from __future__ import annotations

import numpy as np
import zenoh

from bus_schema import Refused, decode
from bus_schema.messages import ContactItem, Forces, Tick
from tests.services.fake_sim import FakeSim
from tests.services.harness import Rig


class FakeModel:
    """Answers every tick with forces that the test chooses; unless silent, late or muddled.

    In free mode the forces of a tick are there before it: a controller that had to wait for them would on a slow machine now and
    then go without.
    """

    def __init__(self, rig: Rig, sim: FakeSim) -> None:
        n = len(rig.robot.motors)
        self.rig, self.collision = rig, np.zeros(n)
        self.silent, self.behind = False, 0  # ticks by which re_k lags
        self.touched: dict[str, list[str]] = {}
        self.contacts: list[ContactItem] | None = []  # which only a controller with user-defined terms reads
        self.part_age = dict.fromkeys(rig.robot.parts, 0)  # ns
        self._forces = rig.bus.publisher(Forces, "model")
        rig.listen(Tick.stream.key(), self._answer)
        sim.before_tick = self._foresee

    def _answer(self, sample: zenoh.Sample) -> None:
        try:
            tick = decode(Tick, sample.payload.to_bytes(), str(sample.encoding))
        except Refused:  # a test of random bytes
            return
        if tick.mode == "lock":
            self._foresee(tick.k)

    def _foresee(self, k: int) -> None:
        if not self.silent:
            self.put(max(k - self.behind, 0))

    def put(self, re_k: int) -> None:
        zeros = [0.0] * len(self.collision)
        collision, age = self.collision.tolist(), self.part_age
        terms = {"limits": zeros, "constraints": zeros, "collision": collision}
        self._forces.put(re_k=re_k, terms=terms, part_age=age, touched=self.touched, contacts=self.contacts)
