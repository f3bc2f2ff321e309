# SPDX-License-Identifier: Apache-2.0
"""Roadmap files (.npz): the arrays of a roadmap, its world, and digests (hashes) of robot and world; written completely or not at all."""

from __future__ import annotations

import hashlib
import json
import math
import zipfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.errors import MobeeError
from mobee.model.world import World
from mobee.model.world_object import FRICTION, Geometry, WorldObject
from mobee.robot.robot import Robot, Shape, per_robot
from mobee.robot.writing import write_whole

_DIGITS, _DECIMALS = 16, 9


@per_robot
def robot_digest(robot: Robot) -> str:
    """Return a hash (16 hex digits) of all properties that determine a robot's poses and contacts.

    Masses, and the names of motors and markers, are included too, since costs and tasks refer to them. The names of the robot, its links
    and its shapes are not included, and the motors' speeds are not included.
    """
    parts: list[bytes] = [b"robot"]
    for joint in robot.joints:
        parts.append(_bytes(joint.kind, joint.parent, joint.axis, joint.point, joint.limits))
    for motor in robot.motor_table:
        parts.append(_bytes(motor.name, motor.part, motor.limits, motor.home, *(number for drive in motor.joints for number in drive)))
    parts += sorted(_bytes(one.name, one.link, one.position, one.rotation, one.normal) for one in robot.markers.values())
    parts += [_shape(one) for one in robot.shapes]
    for body in robot.bodies:
        parts.append(_bytes(body.link, body.mass, body.centre))
    for clause in robot.clauses:
        parts.append(_bytes(clause.part, clause.a, clause.b))
    parts += [_bytes(np.unique(np.sort(pairs, axis=1), axis=0)) for pairs in (robot.solid_pairs, robot.field_pairs)]
    parts.append(_bytes(np.array(sorted(robot.base_shapes))))
    return _digest(parts)


def world_digest(world: World, *, roles: Collection[str] = ("obstacle", "target")) -> str:
    """Return a hash (16 hex digits) of the shapes, poses, roles and carrying links of a world's objects.

    Names, order and colours of the objects do not change the digest. Only objects whose role is in `roles` are included.
    """
    return _digest([b"world", *sorted(_object(one) for one in world.objects.values() if one.role in roles)])


def _shape(shape: Shape) -> bytes:
    vertices = np.empty((0, 3)) if shape.vertices is None else shape.vertices
    return _bytes(shape.kind, shape.role, shape.link, shape.size, shape.position, shape.rotation, vertices)


def _object(one: WorldObject) -> bytes:
    return _bytes(one.kind, one.role, one.link or "", one.size, one.position, one.rotation)


def _bytes(*values: str | ArrayLike) -> bytes:
    """Return text and rounded numbers as bytes, each preceded by its length."""
    found = [value.encode() if isinstance(value, str) else _rounded(value) for value in values]
    return b"".join(len(one).to_bytes(8, "little") + one for one in found)


def _rounded(value: ArrayLike) -> bytes:
    numbers = np.round(np.asarray(value, dtype=np.float64), _DECIMALS) + 0.0  # no minus zero
    return numbers.astype("<f8").tobytes()


def _digest(parts: Iterable[bytes]) -> str:
    whole = hashlib.sha256()
    for part in parts:
        whole.update(len(part).to_bytes(8, "little") + part)
    return whole.hexdigest()[:_DIGITS]


def world_as_json(world: World) -> list[dict[str, Any]]:
    """Return the objects of a world as plain JSON values, in the order in which they were added.

    Each object is a dict: "name"; "kind" and "size" (list of lengths in m) of its shape, as in `mobee.model.world_object.Geometry`;
    "position" (3 numbers, m) and "rotation" (3 rows of 3 numbers), in the root frame, or in the frame of the link that carries the object;
    "role": "obstacle" (repels the robot), "target" (repels it, except the hand that reaches for it) or "ghost" (only drawn); "color": red,
    green, blue and opacity, each 0 to 1, or None; "link": name of the link that carries the object, or None. "mass" [kg] is included only
    for an object that has one, and "friction" only if it is not the usual 0.5: earlier versions of this library do not know these two, and
    ignore them.
    """
    return [
        {
            "name": one.name,
            "kind": one.kind,
            "size": list(one.size),
            "position": one.position.tolist(),
            "rotation": one.rotation.tolist(),
            "role": one.role,
            "color": one.color,
            "link": one.link,
            **({} if one.mass is None else {"mass": one.mass}),
            **({} if one.friction == FRICTION else {"friction": one.friction}),
        }
        for one in world.objects.values()
    ]


def world_from_json(objects: Sequence[dict[str, Any]]) -> World:
    """Return a new world with `objects`, dicts as `world_as_json` returns them; raises KeyError or InvalidValue if they are not valid."""
    world = World()
    for one in objects:
        place = {"position": one["position"], "rotation": one["rotation"]}
        shape = Geometry(one["kind"], tuple(one["size"]))
        free = place if one["link"] is None else {}
        pushed = {"mass": one.get("mass"), "friction": one.get("friction", FRICTION)}
        world.add(one["name"], shape, role=one["role"], color=one["color"], **free, **pushed)
        if one["link"] is not None:
            world.attach(one["name"], one["link"], (one["position"], one["rotation"]))
    return world


FORMAT = "mobee-roadmap 1"
Arrays = dict[str, NDArray[Any]]


def write(path: str | Path, arrays: Mapping[str, NDArray[Any]], notes: Mapping[str, Any]) -> None:
    """Write named arrays of numbers and `notes`, plain JSON values, to a roadmap file.

    After a crash the file is either complete or unchanged. A symbolic link stays one: its target is replaced. Raises MobeeError if the file
    cannot be written.
    """
    place = Path(path)
    text = json.dumps({"format": FORMAT, **notes}, allow_nan=False)
    content = BytesIO()
    np.savez(content, allow_pickle=False, notes=np.frombuffer(text.encode(), dtype=np.uint8), **arrays)
    try:
        write_whole(place, content.getvalue())
    except OSError as error:
        raise MobeeError(f"{place}: the map cannot be written ({error.strerror or error}).") from error


def read(path: str | Path) -> tuple[Arrays, dict[str, Any]]:
    """Return the arrays by name, and the notes (plain JSON values), of a file that `write` wrote.

    Raises MobeeError if the file does not exist, cannot be read, is damaged, or is no roadmap file.
    """
    place = Path(path)
    try:
        with place.open("rb") as raw:
            if not zipfile.is_zipfile(raw):
                raise ValueError("it is no .npz file, or its end is missing")
            _check_sizes(raw)
        with np.load(place, allow_pickle=False) as file:
            arrays: Arrays = {name: file[name] for name in file.files}
        notes = json.loads(arrays.pop("notes").tobytes())
        found = notes.pop("format")
    except FileNotFoundError:
        raise MobeeError(f"{place}: there is no such file. `mobee roadmap build` makes maps.") from None
    except OSError as error:
        raise MobeeError(f"{place}: the map cannot be read ({error.strerror or error}).") from error
    # NotImplementedError: zipfile's for a compression that it does not know, as damaged bytes may name.
    except (ValueError, KeyError, AttributeError, TypeError, EOFError, RecursionError, zipfile.BadZipFile, NotImplementedError) as error:
        raise MobeeError(
            f"{place}: no roadmap, or only a part of one ({_line(error)}). Give another file, or remove it and build it anew."
        ) from error
    if found != FORMAT:
        raise MobeeError(f"{place}: written as {found!r}, this mobee reads {FORMAT!r}. Use the version that wrote it, or build it anew.")
    return arrays, notes


def _check_sizes(raw: BinaryIO) -> None:
    """Raise ValueError if an array claims to be larger than the file, before it is allocated; `write` compresses nothing."""
    with zipfile.ZipFile(raw) as archive:
        for entry in archive.infolist():
            if entry.file_size != entry.compress_size:
                raise ValueError(f"{entry.filename!r} is compressed")
            with archive.open(entry) as array:
                version = np.lib.format.read_magic(array)
                header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, dtype = header(array)
            if math.prod(shape) * dtype.itemsize > entry.file_size:
                raise ValueError(f"{entry.filename!r} claims the shape {shape}, more than its {entry.file_size} bytes")


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
