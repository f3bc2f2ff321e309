# SPDX-License-Identifier: Apache-2.0
"""The controller as a test plays it."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable

import numpy as np

from bus_schema import VERSION, keys
from bus_schema.messages import Clock, Motion
from bus_schema.rpc import Done, Goal, Started, Take, Taken, WithEpoch
from tests.services.harness import Refusal, Rig

RESTART = 0.3  # s from the end of a controller to its successor


class FakeController:
    """The controller of one part, ticking by itself: a goal is reached after some ticks, as `ending` says."""

    def __init__(self, rig: Rig, part: str, period: float = 0.002) -> None:
        self.rig, self.part, self.period = rig, part, period
        self.instance = "c0"
        self.ending = "settled"
        self.lasts = 5  # ticks an action takes
        self.miss = 0.0  # rad by which every motor misses its goal
        self.touched: list[str] = []
        self.goals: list[Goal] = []
        self.loses_answers = 0  # how many answers to goals are lost
        self.on_goal: Callable[[Goal], None] = lambda goal: None
        self.takes = 0
        limits = rig.robot.limits[rig.robot.part(part).slice]
        self.q = limits.mean(axis=1)
        self.epoch, self.owner, self.owner_name = 1000, "", ""
        self.status, self.action_id, self.since_k, self.start_k = "idle", "", 0, 0
        self._target = self.q
        self._started: dict[str, Started] = {}  # by request
        self._lock = threading.RLock()
        self._clock = rig.bus.publisher(Clock)
        self._motion = rig.bus.publisher(Motion, part)
        rig.serve(keys.goal("*", "take"), Take, self._take)
        rig.serve(keys.goal("*", "goal"), Goal, self._goal)
        rig.serve(keys.goal("*", "release"), WithEpoch, self._release)
        rig.token("controller", self.instance)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._ends.set()
        self._thread.join()

    def new_run(self) -> None:
        with self._lock:
            bus = self.rig.bus
            bus.run, bus.k, bus.t = f"run_{secrets.token_hex(3)}", 0, 0
            self._become("held")
            self.resume()

    def restart(self) -> None:
        """Act as a controller that was restarted: silent for a while, then another instance, and no part has an owner.

        Without the silence a service could receive the first `Motion` of the new controller before it knows that the old one has ended.
        """
        with self._lock:
            self.rig.drop_token("controller", self.instance)
            time.sleep(RESTART)
            self.instance = f"c{self.epoch}"
            self.epoch, self.owner = self.epoch + 1000, ""
            self.resume()
        self.rig.token("controller", self.instance)

    def hold(self) -> None:
        with self._lock:
            self._become("held")

    def resume(self) -> None:
        with self._lock:
            self.action_id = ""
            self._become("idle")

    def _run(self) -> None:
        while not self._ends.wait(self.period):
            with self._lock:
                self._tick()

    def _tick(self) -> None:
        bus = self.rig.bus
        bus.k += 1
        bus.t += 10_000_000
        self._clock.put(dt=10_000_000, mode="free", rate=1.0)
        if self.status == "moving" and bus.k - self.start_k >= self.lasts:
            self.q = self._target + self.miss
            self._become(self.ending)
        zeros = [0.0] * len(self.q)
        self._motion.put(
            action_id=self.action_id,
            epoch=self.epoch if self.owner else 0,
            owner=self.owner_name if self.owner else "",
            status=self.status,
            since_k=self.since_k,
            start_k=self.start_k,
            q=self.q.tolist(),
            dq=zeros,
            ddq=zeros,
            goal=self._target.tolist(),
            touched=self.touched,
        )

    def _become(self, status: str) -> None:
        self.status, self.since_k = status, self.rig.bus.k

    def _take(self, request: Take, key: str) -> Taken:
        with self._lock:
            if self.owner not in ("", request.instance) and (request.who, self.owner) in self.rig.alive:
                raise Refusal("owned")
            self.owner, self.owner_name, self.epoch, self.takes = request.instance, request.who, self.epoch + 1, self.takes + 1
            return Taken(v=VERSION, epoch=self.epoch)

    def _release(self, request: WithEpoch, key: str) -> Done:
        with self._lock:
            self.epoch, self.owner, self.action_id = self.epoch + 1, "", ""
            self._become("idle")
            return Done(v=VERSION)

    def _goal(self, request: Goal, key: str) -> Started:
        with self._lock:
            if request.epoch != self.epoch:
                raise Refusal("epoch")
            if self.status == "held":
                raise Refusal("held")
            if request.id not in self._started:
                self._start(request)
            if self.loses_answers:
                self.loses_answers -= 1
                raise Refusal("no_answer")
            return self._started[request.id]

    def _start(self, request: Goal) -> None:
        self.goals.append(request)
        self.on_goal(request)
        self.action_id, self._target, self.start_k = request.action_id, np.array(request.q), self.rig.bus.k
        self._become("moving")
        self._started[request.id] = Started(v=VERSION, k=self.rig.bus.k)
