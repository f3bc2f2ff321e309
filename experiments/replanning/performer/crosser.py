"""Crossings to the other side of a ball that turns solid on the way."""

from __future__ import annotations

import time

import numpy as np

from bus_schema import keys
from bus_schema.rpc import Done, Place, SetRole
from experiments.kit.walking import FeelingPlant
from experiments.replanning.job import Acted, Crossing
from experiments.replanning.scene import BALL, LEFT, RATE, RIGHT, ball, new_map
from mobee import MobeeError, Walker
from mobee.plant import Outcome
from mobee.robot.robot import Array
from services.common.rpc import CallFailed
from services.common.service import Service

AWAY = [0.6, 0.9, 0.6]  # m, where the simulator's ball is in nobody's way


class Crosser:
    """The arm as a plant that notes what is done with it, and who makes the ball solid."""

    def __init__(self, service: Service, hand: FeelingPlant) -> None:
        self.robot, self.motions = hand.robot, list[Acted]()
        self._service, self._hand = service, hand
        self._map = new_map()
        self._place = ball().tolist()  # now: it takes half a second to find out, in which the hand would be on its way
        self._solid_at = self._solid = -1  # ticks
        self._after = -1.0  # s
        self._ended = 0.0  # s of processor time
        hand.each = self._tick

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self._hand.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        space, hand, asked_for = self._map.space, self._hand, time.process_time()
        vertex = int(np.abs(space.samples - target[space.columns]).max(axis=1).argmin())
        outcome = hand.act(part, target)
        bump = -1 if hand.bump is None else hand.bump
        self.motions.append(Acted(vertex, hand.asked, hand.commanded, bump, hand.felt, asked_for - self._ended))
        self._ended = time.process_time()
        return outcome

    def cross(self, after: float) -> Crossing:
        """From the right to the left on a map as it was made; the ball turns solid so many seconds after the start."""
        self.turn(solid=False)
        walker = Walker(new_map(), self, back=False)
        walker.go(RIGHT)
        self.motions.clear()
        self._solid, self._after = -1, after
        walker.go(LEFT)
        return Crossing(self._solid, list(self.motions))

    def turn(self, solid: bool) -> None:
        """Make the ball solid, in the model and in the simulator, or a ghost; in free mode nobody waits until that is done."""
        role, place = "obstacle" if solid else "ghost", self._place if solid else AWAY
        if self._service.locked:
            self._service.call(keys.world_rpc("role"), SetRole, Done, name=BALL, role=role)
            self._service.call(keys.sim("place"), Place, Done, name=BALL, position=place, tries=3)
        else:
            self._service.ask(keys.world_rpc("role"), Done, self._heard, request=SetRole, name=BALL, role=role)
            self._service.ask(keys.sim("place"), Done, self._heard, request=Place, name=BALL, position=place)

    def _heard(self, answer: Done | CallFailed) -> None:
        if isinstance(answer, CallFailed):
            raise MobeeError(f"the ball cannot be changed: {answer}")

    def _tick(self, k: int) -> None:
        """The first motion of a crossing begins when its request has been answered, so the next tick is its first."""
        if self._after >= 0.0 and not self.motions:
            self._solid_at, self._after = k + round(self._after * RATE), -1.0
        if 0 <= self._solid_at <= k:
            self._solid, self._solid_at = k, -1
            self.turn(solid=True)
