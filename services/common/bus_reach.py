"""Reaches on the live plant: presents the target to the model, sends the reach to the controller, waits for its end."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import Geometry, Motion, Reach
from bus_schema.rpc import AddObject, Done, Empty, ObjectState, OneName, World
from mobee.arrays import Array
from mobee.errors import ActionInterrupted, InvalidValue, UnknownName
from mobee.plant import Outcome
from mobee.reach import TARGET, Aim, ReachOutcome, ReachTarget
from services.common.rpc import CallFailed
from services.common.service import Service

TRIES = 3  # of a call to the model, each of half a second
UPRIGHT = [1.0, 0.0, 0.0, 0.0]


class ReachClient:
    """The target of one process, and the newest word on the reaches of its parts."""

    def __init__(self, service: Service, parts: tuple[str, ...]) -> None:
        self._service = service
        self._target: ReachTarget | None = None
        self._object = TARGET
        self._is_there = False  # in the world of the model that runs now
        self._reaches: dict[str, Reach] = {}
        for part in parts:
            service.on_newest(Reach, partial(self._note_reach, part), part)
        service.on_alive(self._note_alive)

    def present(self, target: ReachTarget | None) -> None:
        """See mobee.reach.ReachPlant; raises ActionInterrupted while the model does not answer."""
        if target is not None:
            self._put(target)
        elif self._is_there:
            with suppress(InvalidValue):  # somebody else has taken it away already
                self._call("remove", OneName, name=TARGET)
        self._target, self._object, self._is_there = target, TARGET, target is not None

    def present_object(self, name: str, aim: Aim = "centre", normal: Array | None = None) -> ReachTarget:
        """What is reached for is an object of the model's world, wherever it goes; returns where it is now.

        Raises UnknownName, and InvalidValue if it repels hands, being no target.
        """
        thing = self._known(name)
        if thing.role != "target":
            raise InvalidValue(
                f"{name!r} is an {thing.role} of the model's world: a hand can be put on what has the role target; give it that by "
                f"{keys.world_rpc('role')}, or a place that is free."
            )
        self.present(None)
        self._target, self._object = ReachTarget(np.array(thing.position), _inner_radius(thing.geometry), aim, normal), name
        return self._target

    def asked(self) -> dict[str, object]:
        """The fields of a ReachFor that say what is reached for; raises InvalidValue if nothing is presented."""
        target = self._target
        if target is None:
            raise InvalidValue("nothing is presented to be reached for: call present(ReachTarget(position)) first")
        if self._object == TARGET and not self._is_there:  # the model is a new one
            self._put(target)
            self._is_there = True
        return {
            "object": self._object,
            "position": target.position.tolist(),
            "radius": target.radius,
            "aim": target.aim,
            "normal": None if target.normal is None else target.normal.tolist(),
        }

    def is_told(self, part: str, action_id: str) -> bool:
        """Whether the end of a reach's force is known."""
        reach = self._reaches.get(part)
        return reach is not None and reach.action_id == action_id and reach.phase != "reaching"

    def outcome(self, part: str, motion: Motion, after: Outcome, tick: float) -> ReachOutcome:
        """Of a reach that is over, by its last words; `after`: as of an action, `tick` s."""
        reach = self._reaches[part]
        if reach.phase == "interrupted":
            raise ActionInterrupted(f"{part}: the reach was broken off")
        back = motion.since_k - reach.end_k
        return ReachOutcome(
            marker=np.array(reach.position),
            q=np.array(reach.q),
            missing=reach.missing,
            settled=reach.settled,
            duration=after.duration,
            touched=tuple(reach.touched),
            after=Outcome(after.q, after.settled, back * tick, after.touched) if back else after,
        )

    def leave(self) -> None:
        """Take the target away, if there is one; nobody may be there any more to hear of it."""
        try:
            self.present(None)
        except ActionInterrupted as error:
            self._service.log.info("the target stays where it is: %s", error)

    def _put(self, target: ReachTarget) -> None:
        sphere = Geometry(kind="sphere", size=[target.radius])
        self._call("add", AddObject, name=TARGET, geometry=sphere, position=target.position.tolist(), quaternion=UPRIGHT, role="target")

    def _known(self, name: str) -> ObjectState:
        try:
            objects = {one.name: one for one in self._service.call(keys.world_rpc("list"), Empty, World, tries=TRIES).objects}
        except CallFailed as error:
            raise ActionInterrupted(f"the model does not say what there is: {error}") from None
        if name not in objects:
            raise UnknownName("object of the model's world", name, objects)
        return objects[name]

    def _call(self, verb: str, request: type[AddObject] | type[OneName], **fields: Any) -> None:
        try:
            self._service.call(keys.world_rpc(verb), request, Done, tries=TRIES, **fields)
        except CallFailed as error:
            if error.code == "no_answer":
                raise ActionInterrupted(f"the model does not answer: {error}") from None
            raise InvalidValue(str(error)) from None

    def _note_reach(self, part: str, reach: Reach) -> None:
        self._reaches[part] = reach

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if who == "model":
            self._is_there = False


def _inner_radius(shape: Geometry) -> float:
    """Of the largest sphere about the middle that fits into the shape, in m."""
    if shape.kind == "box":
        return 0.5 * min(shape.size)
    return min(shape.size[0], 0.5 * shape.size[1]) if shape.kind == "cylinder" else shape.size[0]
