"""What must hold in every state of the world and in every evaluation of it, however many threads edit."""

from __future__ import annotations

import math

import numpy as np

from mobee import Model, World
from mobee.collision import Geometry, WorldObject
from mobee.collision.snapshot import ATTACHED, ATTACHED_GHOST, GHOST, OBSTACLE, TARGET, Snapshot
from mobee.engine.volumes import CODES, VOLUME, Volumes
from mobee.model import Pose
from mobee.robot.robot import Robot

FREE = {"obstacle": OBSTACLE, "target": TARGET, "ghost": GHOST}
AGREED = 1e-9  # m, depth of one contact in two evaluations of the same


class WatchedWorld(World):
    """Remembers what was read last, which is what the newest evaluation sees if only one thread evaluates."""

    def __init__(self) -> None:
        super().__init__()
        self.seen = super().snapshot

    @property
    def snapshot(self) -> Snapshot:
        """As World.snapshot."""
        self.seen = super().snapshot
        return self.seen


def torn_table(snapshot: Snapshot) -> str | None:
    """How names, rows, roles and attached contradict the objects, boxes all; None if they agree to the last bit."""
    things = list(snapshot.objects.values())
    if not snapshot.names == tuple(snapshot.objects) == tuple(thing.name for thing in things):
        return "names are not those of the objects"
    roles = [FREE[t.role] if t.link is None else ATTACHED_GHOST if t.role == "ghost" else ATTACHED for t in things]
    if snapshot.roles.tolist() != roles:
        return "roles are not those of the objects"
    if sorted(snapshot.attached) != sorted(thing.name for thing in things if thing.link is not None):
        return "attached are not the objects with a link"
    if not np.array_equal(snapshot.rows, _rows_of_boxes(things)):
        return "rows are not those of the objects"
    return None


def _rows_of_boxes(boxes: list[WorldObject]) -> Volumes:
    """The rows (N,), written apart from what is checked."""
    rows = np.zeros(len(boxes), dtype=VOLUME)
    if not boxes:
        return rows
    rows["kind"] = CODES["box"]
    rows["position"] = [box.position for box in boxes]
    rows["rotation"] = [box.rotation for box in boxes]
    rows["half"] = np.array([box.size for box in boxes]) / 2.0
    rows["bound"] = [math.hypot(*box.size) / 2.0 for box in boxes]
    return rows


def other_objects(pose: Pose, snapshot: Snapshot) -> str | None:
    """How the objects of an evaluation differ from those of the snapshot that it read; None if they are the same."""
    seen = pose.objects
    if tuple(seen) != snapshot.names:
        return "the evaluation has other names than its snapshot"
    other = [name for name, thing in snapshot.objects.items() if thing.link is None and seen[name] is not thing]
    return f"the evaluation has another {other[0]!r} than its snapshot" if other else None


class Reference:
    """A model of its own, in whose world one thread alone puts what a snapshot holds."""

    def __init__(self, robot: Robot) -> None:
        self._model = Model(robot)

    def other_contacts(self, pose: Pose, snapshot: Snapshot) -> str | None:
        """How the contacts of an evaluation differ from those that its snapshot has; None if they are the same."""
        world = self._model.world
        for name in world.objects:
            world.remove(name)
        for name, thing in snapshot.objects.items():
            world.add(name, Geometry(thing.kind, thing.size), position=thing.position, rotation=thing.rotation, role=thing.role)
            if thing.link is not None:
                world.attach(name, thing.link, (thing.position, thing.rotation))
        found, expected = _depths(pose), _depths(self._model.evaluate(pose.q))
        pairs = sorted(p for p in found.keys() | expected.keys() if not abs(found.get(p, 0.0) - expected.get(p, 0.0)) <= AGREED)
        return f"{len(pairs)} contacts of the evaluation are not those of its snapshot: {pairs[:3]}" if pairs else None


def _depths(pose: Pose) -> dict[tuple[str, str, str], float]:
    return {(contact.first, contact.second, contact.kind): contact.depth for contact in pose.contacts}
