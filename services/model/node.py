# SPDX-License-Identifier: Apache-2.0
"""Runs the service `model`: once per tick, computes the constraint forces from the newest state of every part.

Constraint forces push the robot away from motor limits and contacts.
"""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from bus_schema import VERSION, keys
from bus_schema.messages import ContactItem, Contacts, Forces, MarkerPose, Pose, Reach, Targets, Tick
from bus_schema.rpc import JacobianAt, JacobianReply
from mobee import Gains, Model
from mobee.arrays import Array
from mobee.control import constraint_forces
from mobee.control.forces import needs_contacts, published_terms
from mobee.errors import MobeeError
from mobee.model.contact import KINDS, Contact
from mobee.model.engine import MAX_HANDS
from mobee.model.kinematics import quaternion_from_matrix
from mobee.model.pose import Pose as ModelPose
from mobee.model.pose import touched
from mobee.robot.cameras import cameras_of
from mobee.robot.robot import Robot
from mobee.vision.calibration.calibration import load_calibration
from services.common.lockstep import Participant
from services.common.rate import Percentiles
from services.common.service import CallRefused, Service
from services.common.worlds import TABLE
from services.model.config import Config
from services.model.world import WorldServer


class ModelNode:
    """Evaluates the model of robot and world once per tick; publishes constraint forces, marker poses, contacts and targets of reaches."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._service, self._config, self._robot = service, config, robot
        self._model = Model(robot, config.load_world())
        for name, item in list(self._model.world.objects.items()):
            if item.role == "target":
                self._model.world.remove(name)
        self._track = self._model.track()
        self._gains = Gains.named(config.gains)
        self._publishes_contacts = bool(config.terms) or needs_contacts()
        self._q: Array = robot.home
        self._offsets = _encoder_offsets(config, robot)
        self._world = WorldServer(service, self._model, config.sigmas, config.ghosts)
        bus = service.bus
        self._forces = bus.publisher(Forces, "model")
        self._participant = Participant(service)
        self._pose = bus.publisher(Pose)
        self._contacts = bus.publisher(Contacts)
        self._targets = bus.publisher(Targets)
        self._reaches: dict[str, Reach] = {}  # of the parts that are reaching
        self._reaching: tuple[str, ...] | None = None  # their markers
        self._last_k = -1
        self._last_contacts: tuple[bytes, tuple[str, ...]] = b"", ()  # of the last tick; the next three are computed from them
        self._touching: dict[str, list[str]] = {}  # world objects by part
        self._touches_table = False
        self._kinds: set[str] = set()
        self._time = Percentiles()
        self._mark()
        service.mark, service.describe = self._mark, self._describe
        service.on_request(keys.MODEL_JACOBIAN, JacobianAt, lambda r, _: self._jacobian(r))
        service.on_run(self._new_run)
        service.on_alive(self._note_alive)
        for part in robot.parts:
            service.on_newest(Reach, partial(self._note_reach, part), part)
        service.on_tick(self._tick)
        constraint_forces(self._world.pose, self._gains, config.propagate)  # fills caches before the robot moves

    def _new_run(self) -> None:
        self._world.forget()
        self._forget_reaches()
        self._last_k = -1

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if who == "controller" and not up:
            self._forget_reaches()

    def _forget_reaches(self) -> None:
        self._reaches.clear()
        self._reaching = None

    def _note_reach(self, part: str, reach: Reach) -> None:
        """Store the newest message about a reach (motion of a marker, a named point of a link, to a target).

        While the reach lasts, targets exert no force on the hand of this marker.
        """
        if reach.marker not in self._robot.markers:
            self._service.bus.reject("value", f"a reach of {part} with the marker {reach.marker!r}, which this robot does not have")
            return
        if reach.phase == "reaching":
            self._reaches[part] = reach
        else:
            self._reaches.pop(part, None)
        self._reaching = tuple(dict.fromkeys(one.marker for one in self._reaches.values()))[:MAX_HANDS] or None

    def _tick(self, tick: Tick) -> None:
        begin = time.perf_counter()
        self._world.expire(tick.t)
        self._q = np.array(tick.q) if self._offsets is None else np.array(tick.q) + self._offsets
        pose = self._world.pose = self._track.evaluate(self._q, self._reaching)
        forces = constraint_forces(pose, self._gains, self._config.propagate, self._config.contact_forces)
        self._note_contacts(pose)
        if self._reaches:
            names = {reach.object for reach in self._reaches.values()}
            positions = self._world.positions(names)
            self._targets.put(re_k=tick.k, positions=positions, gone=sorted(names - positions.keys()))
        self._forces.put(
            re_k=tick.k,
            terms={name: forces[name].tolist() for name in published_terms()},
            part_age={part: tick.t - status.t for part, status in tick.parts.items()},
            touched=self._touching,
            contacts=[_item(contact) for contact in pose.contacts] if self._publishes_contacts else None,
        )
        self._time.add(1e3 * (time.perf_counter() - begin))
        self._participant.done(tick.k, implied=tick.k > 0 and bool(self._service.alive.get("controller")))
        self._publish_for_viewers(tick.k, pose)
        self._count(tick.k)

    def _publish_for_viewers(self, k: int, pose: ModelPose) -> None:
        """Publish pose and contacts if there are subscribers; in lockstep this is queued, so that the forces are sent first."""
        if self._pose.has_subscribers or self._contacts.has_subscribers:
            if self._service.locked:
                self._service.inbox.put(partial(self._publish_pose, k, pose))
            else:
                self._publish_pose(k, pose)

    def _publish_pose(self, k: int, pose: ModelPose) -> None:
        if self._pose.has_subscribers:
            markers = [
                MarkerPose(
                    name=name, position=pose.position(name).tolist(), quaternion=quaternion_from_matrix(pose.rotation(name)).tolist()
                )
                for name in self._robot.markers
            ]
            self._pose.put(re_k=k, q=self._q.tolist(), markers=markers)
        if self._contacts.has_subscribers:
            self._contacts.put(re_k=k, contacts=[_item(contact) for contact in pose.contacts])

    def _note_contacts(self, pose: ModelPose) -> None:
        """Update the objects that the parts touch, if the contacts differ from those of the last tick."""
        table = pose.table
        contacts = table.numbers.tobytes(), table.objects
        if contacts != self._last_contacts:
            self._last_contacts = contacts
            self._touching = {part: list(names) for part, names in touched(pose).items() if names}
            self._touches_table = any(TABLE in names for names in self._touching.values())
            self._kinds = {KINDS[kind] for kind in table.kind.tolist()}

    def _count(self, k: int) -> None:
        self._ticks += 1
        if 0 <= self._last_k < k:
            self._skipped += k - self._last_k - 1
        self._last_k = k
        self._table_ticks += self._touches_table
        self._field_ticks += "field" in self._kinds
        self._solid_ticks += "solid" in self._kinds

    def _mark(self) -> None:
        self._ticks = self._skipped = self._table_ticks = self._field_ticks = self._solid_ticks = 0
        self._time.clear()
        self._world.latency.clear()

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "ticks": self._ticks,
            "skipped": self._skipped,
            "table_ticks": self._table_ticks,
            "field_ticks": self._field_ticks,
            "solid_ticks": self._solid_ticks,
            "objects": len(self._model.world.objects),
            "perceived_ms_p50": self._world.latency.at(50),
            "perceived_ms_p95": self._world.latency.at(95),
            "evaluate_ms_p50": self._time.at(50),
            "evaluate_ms_p99": self._time.at(99),
        }
        table = f", touching the table in {self._table_ticks}" if TABLE in self._model.world.objects else ""
        return f"{self._ticks} ticks{table}", numbers

    def _jacobian(self, request: JacobianAt) -> JacobianReply:
        q = self._q if request.q is None else np.array(request.q)
        try:
            jacobian = self._model.jacobian(q, request.marker)
        except MobeeError as error:
            raise CallRefused("marker", str(error)) from None
        return JacobianReply(v=VERSION, rows=jacobian.shape[0], columns=jacobian.shape[1], data=jacobian.ravel().tolist())


def _encoder_offsets(config: Config, robot: Robot) -> Array | None:
    """Return the true positions minus those of the encoders (n,) rad, from the calibration file; None if no file is configured.

    Raises InvalidValue if the file cannot be read, or belongs to another robot or other cameras.
    """
    if not config.calibration:
        return None
    return load_calibration(config.calibration).errors(robot, cameras_of(robot)).encoders


def _item(c: Contact) -> ContactItem:
    return ContactItem(
        first=c.first,
        second=c.second,
        kind=c.kind,
        depth=float(c.depth),
        point=c.point.tolist(),
        normal=c.normal.tolist(),
        first_link=c.first_link,
        second_link=c.second_link,
    )
