# SPDX-License-Identifier: Apache-2.0
"""The live plant (the running robot) of an agent whose states contain the position of an object.

An action ends when the object is seen at rest in its area, a rectangle in x and y that the agent's settings define.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bus_schema import keys
from bus_schema.rpc import Done, ObjectState, Place
from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.learning.object_space import MARGIN, ObjectSpace
from mobee.plant import Outcome, PerceivingPlant
from services.agents.config import Config
from services.common.bus_plant import BusPlant
from services.common.rpc import CallFailed
from services.common.service import Service

LOOK = 2.0  # s of the robot's clock within which an object that nothing hides is seen at rest
PERIOD = 0.05  # s of real time between two looks
CALM = 0.005  # m between the places of two looks at an object at rest
PATIENCE = 10.0  # s of the robot's clock after which the simulator is asked again


class ObjectPlant(PerceivingPlant):
    """A live plant that perceives one object: an action ends only when vision has seen this object at rest in its area.

    Pictures that were taken before the end of the motion do not count. If the object is not seen in the area within 2 s (LOOK), the part
    moves to the posture `aside` of the settings, because it may hide the object. If the object is seen then, the action ends. Otherwise it
    has fallen or has left the area: the simulator or a person puts it back, and the action ends when it is seen in the area. So an outcome
    always contains the position of the object after the action.

    Args:
        service: the service of the agent.
        plant: the plant on which the actions are performed.
        config: names the object, its area, and what happens when the object is not seen.
        space: the state space of the agent.
    """

    def __init__(self, service: Service, plant: BusPlant, config: Config, space: ObjectSpace) -> None:
        super().__init__(plant, lambda: {} if self._place is None else {config.object: self._place})
        self._service, self._bus_plant, self._name, self._part = service, plant, config.object, config.part
        self._aside, self._put_back = space.postures.target(config.aside), config.put_back
        self._low, self._high = np.array(config.area).T
        self._place: Array | None = None  # (3,) m, at the last look
        self.is_absent = False
        """Whether the agent waits until the object is back."""
        self.absences = 0
        """How often the object had fallen or left its area."""
        self.retreats = 0
        """How often the part moved aside because the object was not seen."""

    def measure(self, part: str) -> Array:
        """Wait until the object is seen in its area, then return the part's motor positions (n_part,) rad.

        If the object is not seen within 2 s (LOOK) of the robot's clock, the part moves to the posture `aside` of the settings, and the
        wait continues there.

        Implements `mobee.plant.Plant.measure`.
        """
        self.plant.measure(part)
        self._look()
        return self.plant.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """Set the part's attractor to `target` (n_part,) rad, wait until the part settles or times out, then until the object is seen.

        Implements `mobee.plant.Plant.act`. The outcome contains the position of the object after the action, and the posture from which it
        was seen.
        """
        outcome = self.plant.act(part, target)
        q = self.plant.measure(part) if self._look() else outcome.q
        return replace(outcome, q=q, perceived=self.perceive())

    def _look(self) -> bool:
        """Wait until the object is seen in its area; return whether the part was moved for this.  Raises ActionInterrupted as `act`."""
        if self._is_seen(LOOK):
            return False
        self.retreats += 1
        self.plant.act(self._part, self._aside)
        if not self._is_seen(LOOK):
            self._wait_for_object()
        return True

    def _wait_for_object(self) -> None:
        self.absences += 1
        self.is_absent = True
        remedy = "the simulator puts it back" if self._put_back else "put it back"
        self._service.bus.event("warning", "object_absent", f"{self._name} is not seen in its area: {remedy}; {self._part} waits aside")
        try:
            self._ask_simulator()
            while not self._is_seen(PATIENCE):
                self._ask_simulator()
        finally:
            self.is_absent = False
        self._service.bus.event("info", "object_back", f"{self._name} is seen in its area again")

    def _ask_simulator(self) -> None:
        """Set the object down at its first place, where there is a simulator and the settings say so."""
        if not self._put_back:
            return
        try:
            self._service.call(keys.sim("place"), Place, Done, name=self._name, position=list(self._put_back))
        except CallFailed as error:
            self._service.log.warning("%s was not put back: %s", self._name, error)

    def _is_seen(self, patience: float) -> bool:
        """Look for the object for some seconds of the robot's clock; returns whether it rests in its area, and notes its place."""
        begun = self._service.bus.t
        before: ObjectState | None = None
        while True:
            seen = self._seen_after(begun)
            if seen is not None and seen.t_capture is None:  # of the model's file: known exactly
                self._place = np.array(seen.position)
                return True
            if seen is not None and before is not None and seen.t_capture != before.t_capture:
                if np.linalg.norm(np.subtract(seen.position, before.position)) < CALM:
                    self._place = np.array(seen.position)
                    return True
            before = seen
            if self._service.bus.t - begun > 1e9 * patience:
                return False
            self._bus_plant.pause(PERIOD)

    def _seen_after(self, begun: int) -> ObjectState | None:
        """Return the object if a picture after a time [ns] shows it in its area.

        Raises MobeeError if the object repels the hand: what the agent would learn then is not how it pushes the object.
        """
        found = self._bus_plant.objects().get(self._name)
        if found is None or (found.t_capture is not None and found.t_capture <= begun):
            return None
        if found.role != "ghost":
            raise MobeeError(
                f"{self._name} has the role {found.role} in the model's world and repels the hand that is to push it: set "
                f'services.model.ghosts = ["{self._name}"], or its role in the world\'s file to ghost.'
            )
        at = np.array(found.position[:2])
        is_inside = bool(((at > self._low - MARGIN) & (at < self._high + MARGIN)).all())  # places are seen with errors
        return found if is_inside else None
