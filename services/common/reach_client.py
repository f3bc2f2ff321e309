# SPDX-License-Identifier: Apache-2.0
"""The client's side of a reach on the bus: the target that a process puts into the model's world, and what the controller reports."""

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

TRIES = 3  # of a call, each of half a second: the caller must know whether the call had its effect
UPRIGHT = [1.0, 0.0, 0.0, 0.0]


class ReachClient:
    """The client's side of reaches: presents a target to the model, and keeps the newest `Reach` message of each part."""

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
        """Put a target into the model's world as the object `reach_target`, or move it there; None removes it.

        Implements `mobee.reach.ReachPlant.present`. Raises ActionInterrupted if the model does not answer, or if another service presents
        a target; InvalidValue if the model refuses the target.
        """
        if target is not None:
            self._put(target)
        else:
            self._remove()
        self._target, self._object, self._is_there = target, TARGET, target is not None

    def present_object(self, name: str, aim: Aim = "centre", normal: Array | None = None, faces: bool = False) -> ReachTarget:
        """Use the object `name` of the model's world as the target of reaches; return the target at its present position.

        If the object moves, reaches follow it. `aim`: the marker has to reach the "centre" or the "surface" of the target. `normal`:
        desired direction (3,) of the marker's normal, root frame; None: any. `faces`: True: the normal has to point at the target. Raises
        UnknownName if there is no such object; InvalidValue if the object is stale, that is, not seen any more, or if its role is not
        "target" (an object with the role "obstacle" repels the hand); ActionInterrupted if the model does not answer.
        """
        found = self._known(name)
        if found.role != "target":
            raise InvalidValue(
                f"{name!r} has the role {found.role} in the model's world, and hands reach only for the role target: change the role "
                f"by {keys.world_rpc('role')}, or reach for a free position."
            )
        self.present(None)
        self._target, self._object = ReachTarget(np.array(found.position), inner_radius(found), aim, normal, faces), name
        return self._target

    def asked(self) -> dict[str, object]:
        """Return the fields of a `ReachFor` request (a call that starts a reach) that describe the presented target.

        They are "object", "position", "radius", "aim", "normal" and "faces". If the model has been restarted since `present`, the target is
        first put into its world again. Raises InvalidValue if no target is presented.
        """
        target = self._target
        if target is None:
            raise InvalidValue("no target is presented: call present(ReachTarget(position)) first")
        if self._object == TARGET and not self._is_there:  # the model was started again
            self._put(target)
            self._is_there = True
        return {
            "object": self._object,
            "position": target.position.tolist(),
            "radius": target.radius,
            "aim": target.aim,
            "normal": None if target.normal is None else target.normal.tolist(),
            "faces": target.faces,
        }

    def attached_to(self) -> tuple[str, str]:
        """Return the names of the presented object and of the link to which it is attached; the second is empty if there is none.

        Raises ActionInterrupted if the model does not answer.
        """
        if self._object == TARGET:  # this service has put it there
            return TARGET, ""
        return self._object, next((one.link for one in self._listed().objects if one.name == self._object), "")

    def has_ended(self, part: str, action_id: str) -> bool:
        """Return whether the controller has reported that the force of a part's reach has ended. `action_id`: id of this reach."""
        reach = self._reaches.get(part)
        return reach is not None and reach.action_id == action_id and reach.phase != "reaching"

    def outcome(self, part: str, motion: Motion, after: Outcome, tick: float) -> ReachOutcome:
        """Return the outcome of a part's reach that has ended; raises ActionInterrupted if the reach was interrupted.

        A reach has two phases: a force pulls the marker, then the attractor pulls the part back. `motion`: the last `Motion` message of the
        part. `after`: outcome at the end of the second phase; its `duration` must be that of both phases. `tick`: length of a tick, s.
        """
        reach = self._reaches[part]
        if reach.phase == "interrupted":
            raise ActionInterrupted(f"{part}: the reach was interrupted")
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

    def withdraw(self) -> None:
        """Remove the target from the model's world until the next reach, so that another service can present one meanwhile.

        It is no error if there is no target, or if the model has already ended.
        """
        try:
            self._remove()
        except ActionInterrupted as error:
            self._service.log.info("the target could not be removed: %s", error)
        self._is_there = False

    def _remove(self) -> None:
        if self._is_there:
            with suppress(InvalidValue):  # another client has removed it already
                self._call("remove", OneName, name=TARGET)

    def _put(self, target: ReachTarget) -> None:
        sphere = Geometry(kind="sphere", size=[target.radius])
        self._call("add", AddObject, name=TARGET, geometry=sphere, position=target.position.tolist(), quaternion=UPRIGHT, role="target")

    def objects(self) -> dict[str, ObjectState]:
        """Return the objects of the model's world that are not attached to a link, by name.

        Raises ActionInterrupted if the model does not answer.
        """
        return {one.name: one for one in self._listed().objects if not one.link}

    def _listed(self) -> World:
        try:
            return self._service.call(keys.world_rpc("list"), Empty, World, tries=TRIES)
        except CallFailed as error:
            raise ActionInterrupted(f"the model does not list its objects: {error}") from None

    def _known(self, name: str) -> ObjectState:
        world = self._listed()
        objects = {one.name: one for one in world.objects}
        if name in world.stale:
            raise InvalidValue(
                f"{name!r} is stale: the newest picture that shows it is {world.stale[name]:.1f} s old, and it may be elsewhere. "
                "`mobee status` shows what vision sees; reach for it when it is seen again, or for a place with --target."
            )
        if name not in objects:
            raise UnknownName("object of the model's world", name, objects)
        return objects[name]

    def _call(self, verb: str, request: type[AddObject] | type[OneName], **fields: Any) -> None:
        try:
            self._service.call(keys.world_rpc(verb), request, Done, tries=TRIES, **fields)
        except CallFailed as error:
            if error.code == "no_answer":
                raise ActionInterrupted(f"the model does not answer: {error}") from None
            if error.code == "owned":
                raise ActionInterrupted(str(error)) from None
            raise InvalidValue(str(error)) from None

    def _note_reach(self, part: str, reach: Reach) -> None:
        self._reaches[part] = reach

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if who == "model":
            self._is_there = False


def inner_radius(found: ObjectState) -> float:
    """Return the radius [m] of the largest sphere about the centre that fits into an object, without the margin of its shape."""
    shape = found.geometry
    if shape.kind == "box":
        radius = 0.5 * min(shape.size)
    else:
        radius = min(shape.size[0], 0.5 * shape.size[1]) if shape.kind == "cylinder" else shape.size[0]
    return radius - found.margin
