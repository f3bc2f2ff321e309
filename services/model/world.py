# SPDX-License-Identifier: Apache-2.0
"""Edits the model's world, by calls of clients and by messages of vision."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
from msgspec.structs import replace

from bus_schema import VERSION, keys
from bus_schema.messages import Geometry, Role, WorldObject
from bus_schema.rpc import AddObject, Attach, Done, Empty, MoveObject, ObjectState, OneName, SetRole
from bus_schema.rpc import World as WorldReply
from mobee import Model, World
from mobee.arrays import Array
from mobee.errors import InvalidValue, MobeeError
from mobee.model import WorldObject as Thing
from mobee.model import world_object as geometry
from mobee.model.kinematics import matrix_from_quaternion
from mobee.model.world import placed
from mobee.model.world_object import valid_position, valid_shape
from mobee.reach import TARGET
from services.common.rate import Percentiles
from services.common.service import CallRefused, Service
from services.common.worlds import object_state, require_sizes

DONE = Done(v=VERSION)
MARGIN_STEP = 0.002  # m between two margins
MOST_MARGIN = 0.06  # m: an object whose place is less certain is no use as a target, and would push the robot away as an obstacle


class WorldServer:
    """Changes the world of a model. Clients request changes by calls; vision sends the objects that it perceives."""

    def __init__(self, service: Service, model: Model, sigmas: float, ghosts: Collection[str] = ()) -> None:
        """Begin to answer the calls that edit the world of `model`, and to receive the objects that vision perceives.

        `sigmas`: number of standard deviations of a perceived object's position by which its shape is enlarged. `ghosts`: names of
        perceived objects that get the role "ghost" (exerts no force on the robot) instead of the role that vision sends.
        """
        self._service, self._model, self._sigmas, self._ghosts = service, model, sigmas, frozenset(ghosts)
        self.latency = Percentiles()  # ms from the picture that shows an object to its place in the world
        self.pose = model.evaluate(model.robot.home)  # the newest, for objects attached to a link
        self._expiry: dict[str, int] = {}  # ns of the bus clock, of the objects that vision added: it changes no other
        self._margins: dict[str, float] = {}  # m, of perceived objects
        self._roles: dict[str, Role] = {}  # of perceived objects, that clients have set
        self._captured: dict[str, int] = {}  # ns, time of the newest picture of each perceived object, stale ones too
        self._presenter = ""  # service that presents the target
        service.on_alive(self._note_alive)
        service.on_each(WorldObject, self._perceive)
        service.on_request(keys.world_rpc("add"), AddObject, lambda r, _: self._edit(lambda w: self._add(w, r)))
        service.on_request(keys.world_rpc("move"), MoveObject, lambda r, _: self._edit(lambda w: self._move(w, r)))
        service.on_request(keys.world_rpc("remove"), OneName, lambda r, _: self._edit(lambda w: self._remove(w, r.name)))
        service.on_request(keys.world_rpc("role"), SetRole, lambda r, _: self._edit(lambda w: self._set_role(w, r)))
        service.on_request(keys.world_rpc("attach"), Attach, lambda r, _: self._edit(lambda w: self._attach(w, r)))
        service.on_request(keys.world_rpc("detach"), OneName, lambda r, _: self._edit(lambda w: self._detach(w, r.name)))
        service.on_request(keys.world_rpc("list"), Empty, lambda r, _: self._list())

    def expire(self, t: int) -> None:
        """Remove the perceived objects whose time of validity is over; `t`: present time, ns of the bus clock.

        An object that is attached to a link stays until it is detached, since a hand may hide it from the eyes.
        """
        for name in [name for name, until in self._expiry.items() if until < t and not self._is_attached(name)]:
            self._expire(name, "it was not seen again in time")

    def positions(self, names: Collection[str]) -> dict[str, list[float]]:
        """Return a dict from each of the names to the position [m], root frame, of the object; names not in the world are left out."""
        known = self._model.world.objects
        return {name: self._in_root_frame(known[name]).position.tolist() for name in sorted(names) if name in known}

    def forget(self) -> None:
        """Remove the objects that vision perceived in the last run; call this at the start of a new run."""
        for name in list(self._expiry):
            self._remove(self._model.world, name)
        self._captured.clear()

    def _perceive(self, seen: WorldObject) -> None:
        world = self._model.world
        is_new = seen.name not in world.objects
        if not is_new and seen.name not in self._expiry:
            self._service.bus.reject(
                "authority", f"{seen.src} sees {seen.name!r}, which the scenario or a client placed: it stays as it is"
            )
            return
        if not is_new and self._is_attached(seen.name):  # its place follows from the link
            self._expiry[seen.name], self._captured[seen.name] = seen.valid_until, seen.t_capture
            return
        margin = self._margin(seen)
        if seen.valid_until < self._service.bus.t or margin > MOST_MARGIN:
            self._captured[seen.name] = seen.t_capture
            if not is_new:
                self._expire(seen.name, "vision withdrew it" if margin <= MOST_MARGIN else "its place has become too uncertain")
            return
        try:
            self._put(world, seen, margin)
        except MobeeError as error:
            self._service.bus.reject("world", str(error))
            return
        if seen.t_capture > self._captured.get(seen.name, -1):
            self.latency.add(1e-6 * (self._service.bus.now() - seen.t_capture))
        self._margins[seen.name], self._captured[seen.name] = margin, seen.t_capture
        self._expiry[seen.name] = seen.valid_until

    def _is_attached(self, name: str) -> bool:
        return self._model.world.objects[name].link is not None

    def _margin(self, seen: WorldObject) -> float:
        """Return the distance [m] by which a perceived shape is enlarged for its position uncertainty.

        The present distance is kept if it is enough and not much too large, so that the shape need not change.
        """
        largest = float(np.linalg.eigvalsh(np.array(seen.covariance).reshape(3, 3))[-1])
        wanted = self._sigmas * np.sqrt(max(largest, 0.0))
        present = self._margins.get(seen.name, 0.0)
        return present if wanted <= present <= wanted + 2.0 * MARGIN_STEP else float(np.ceil(wanted / MARGIN_STEP) * MARGIN_STEP)

    def _expire(self, name: str, why: str) -> None:
        self._remove(self._model.world, name)
        self._service.bus.event("info", "expired", f"{name} was removed: {why}")

    def _edit(self, change: Callable[[World], object]) -> Done:
        try:
            change(self._model.world)
        except MobeeError as error:
            raise CallRefused("world", str(error)) from None
        return DONE

    def _add(self, world: World, request: AddObject) -> None:
        if request.name == TARGET:
            self._require_presenter(request.who)
        self._put(world, request)
        self._forget(request.name)  # the client that added it removes it

    def _require_presenter(self, who: str) -> None:
        """Refuse a second service that presents a target (object to reach for), since both would move the same object.

        Raises CallRefused if another running service presents it; else `who` now presents it.
        """
        other = self._presenter
        if TARGET in self._model.world.objects and other != who and self._service.alive.get(other):
            raise CallRefused(
                "owned",
                f"{other} presents {TARGET!r}, and only one service at a time can: {who} can after {other} has ended, or rests. "
                "A scenario can have one agent with targets.",
            )
        self._presenter = who

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        """Remove the target when the service that presents it has ended."""
        if not up and who == self._presenter and not self._service.alive.get(who) and TARGET in self._model.world.objects:
            self._remove(self._model.world, TARGET)
            self._service.bus.event("info", "target_gone", f"{TARGET} was removed: {who}, which presented it, has ended")

    def _attach(self, world: World, request: Attach) -> None:
        world.follow(self.pose)
        world.attach(request.name, request.link)

    def _detach(self, world: World, name: str) -> None:
        world.follow(self.pose)
        world.detach(name)

    def _set_role(self, world: World, request: SetRole) -> None:
        """Set the role of an object.

        If vision perceives the object, the role is also stored until the object is removed or a client adds it, since every new message of
        vision would reset it.
        """
        world.set_role(request.name, request.role)
        if request.name in self._expiry:
            self._roles[request.name] = request.role

    def _remove(self, world: World, name: str) -> None:
        world.remove(name)
        self._forget(name)

    def _forget(self, name: str) -> None:
        """Forget that vision perceived an object."""
        for known in (self._expiry, self._margins, self._roles):
            known.pop(name, None)

    def _put(self, world: World, seen: WorldObject | AddObject, margin: float = 0.0) -> None:
        known = world.objects.get(seen.name)
        rotation = _rotation(seen.quaternion)
        shape, role = _shape(seen.geometry, margin), self._role_of(seen)
        if known is not None and known.link is None and known.kind == shape.kind and known.size == shape.size:
            world.move(seen.name, position=seen.position, rotation=rotation)
            if known.role != role:
                world.set_role(seen.name, role)
            return
        valid_shape(seen.name, shape)
        valid_position(seen.name, seen.position)
        if known is not None:  # after the checks: an invalid object replaces nothing
            world.remove(seen.name)
        world.add(seen.name, shape, position=seen.position, rotation=rotation, role=role)

    def _role_of(self, seen: WorldObject | AddObject) -> Role:
        """Return the role of an object: as it was sent; if vision perceives it, first that which a client or the settings have set."""
        if isinstance(seen, AddObject):
            return seen.role
        return self._roles.get(seen.name, "ghost" if seen.name in self._ghosts else seen.role)

    def _move(self, world: World, request: MoveObject) -> None:
        rotation = None if request.quaternion is None else _rotation(request.quaternion)
        world.move(request.name, position=request.position, rotation=rotation)

    def _list(self) -> WorldReply:
        things = self._model.world.objects
        return WorldReply(
            v=VERSION,
            objects=[self._state(thing) for thing in things.values()],
            stale={name: 1e-9 * (self._service.bus.t - t) for name, t in self._captured.items() if name not in things},
        )

    def _state(self, thing: Thing) -> ObjectState:
        found = object_state(self._in_root_frame(thing), thing.link or "")
        if thing.name not in self._expiry:
            return found
        return replace(found, margin=self._margins.get(thing.name, 0.0), t_capture=self._captured.get(thing.name))

    def _in_root_frame(self, thing: Thing) -> Thing:
        if thing.link is None:
            return thing
        return placed(thing, self.pose.transforms[self._model.robot.links.index(thing.link)])


def _shape(given: Geometry, margin: float) -> geometry.Geometry:
    """Return a shape of the bus, larger by a margin [m] on each side, as a Geometry; raises InvalidValue for a wrong number of sizes."""
    require_sizes(given)
    return geometry.Geometry(given.kind, tuple(given.size)).grown(margin)


def _rotation(quaternion: list[float]) -> Array:
    """Return the rotation matrix (3, 3) of a quaternion wxyz; raises InvalidValue if its length is far from 1."""
    if not 0.5 < np.linalg.norm(quaternion) < 2.0:
        raise InvalidValue(f"quaternion {quaternion}: must be of length 1")
    return matrix_from_quaternion(np.array(quaternion))
