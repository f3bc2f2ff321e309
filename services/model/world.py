"""Edits of the model's world: by call, and by what is perceived."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bus_schema import VERSION, keys
from bus_schema.messages import Geometry, WorldObject
from bus_schema.rpc import AddObject, Attach, Done, Empty, MoveObject, ObjectState, OneName, SetRole
from bus_schema.rpc import World as WorldReply
from mobee import Model, World
from mobee.collision import geometry
from mobee.errors import MobeeError
from mobee.kinematics.quaternion import from_matrix, to_matrix
from services.common.service import CallRefused, Service

DONE = Done(v=VERSION)


class WorldDesk:
    """Serves the world of a model on the bus."""

    def __init__(self, service: Service, model: Model) -> None:
        self._service, self._model = service, model
        self._expiry: dict[str, int] = {}  # ns of the bus clock
        service.on_each(keys.ALL_WORLD, WorldObject, self._perceive)
        service.on_request(keys.world_rpc("add"), AddObject, lambda r, _: self._edit(lambda w: self._put(w, r)))
        service.on_request(keys.world_rpc("move"), MoveObject, lambda r, _: self._edit(lambda w: self._move(w, r)))
        service.on_request(keys.world_rpc("remove"), OneName, lambda r, _: self._edit(lambda w: w.remove(r.name)))
        service.on_request(keys.world_rpc("role"), SetRole, lambda r, _: self._edit(lambda w: w.set_role(r.name, r.role)))
        service.on_request(keys.world_rpc("attach"), Attach, lambda r, _: self._edit(lambda w: w.attach(r.name, r.link)))
        service.on_request(keys.world_rpc("detach"), OneName, lambda r, _: self._edit(lambda w: w.detach(r.name)))
        service.on_request(keys.world_rpc("list"), Empty, lambda r, _: self._list())

    def expire(self, t: int) -> None:
        """Forget what was perceived and not seen again in time; t in ns of the bus clock."""
        for name in [name for name, until in self._expiry.items() if until < t]:
            del self._expiry[name]
            if name in self._model.world.objects:
                self._model.world.remove(name)
                self._service.bus.event("info", "expired", f"{name} was not seen again in time")

    def _perceive(self, seen: WorldObject) -> None:
        try:
            self._put(self._model.world, seen)
        except MobeeError as error:
            self._service.bus.reject("world", str(error))
            return
        self._expiry[seen.name] = seen.valid_until

    def _edit(self, change: Callable[[World], object]) -> Done:
        try:
            change(self._model.world)
        except MobeeError as error:
            raise CallRefused("world", str(error)) from None
        return DONE

    def _put(self, world: World, seen: WorldObject | AddObject) -> None:
        known = world.objects.get(seen.name)
        rotation = to_matrix(np.array(seen.quaternion))
        if known is not None and known.kind == seen.geometry.kind and list(known.size) == seen.geometry.size:
            world.move(seen.name, position=seen.position, rotation=rotation)
            if known.role != seen.role:
                world.set_role(seen.name, seen.role)
            return
        shape = geometry.Geometry(seen.geometry.kind, tuple(seen.geometry.size))
        if known is not None:
            world.remove(seen.name)
        world.add(seen.name, shape, position=seen.position, rotation=rotation, role=seen.role)

    def _move(self, world: World, request: MoveObject) -> None:
        rotation = None if request.quaternion is None else to_matrix(np.array(request.quaternion))
        world.move(request.name, position=request.position, rotation=rotation)

    def _list(self) -> WorldReply:
        objects = [
            ObjectState(
                name=o.name,
                geometry=Geometry(kind=o.kind, size=list(o.size)),
                position=o.position.tolist(),
                quaternion=from_matrix(o.rotation).tolist(),
                role=o.role,
                link=o.link or "",
            )
            for o in self._model.world.objects.values()
        ]
        return WorldReply(v=VERSION, objects=objects)
