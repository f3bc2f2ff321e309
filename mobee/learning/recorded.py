"""A space from the record of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mobee.errors import InvalidValue, MobeeError
from mobee.learning.lattice import Lattice
from mobee.learning.space import Space
from mobee.learning.voronoi import Voronoi
from mobee.robot.robot import Robot

_OF_A_RECORD = {"robot", "digest", "kind"}


def space_from(settings: Mapping[str, Any], robot: Robot) -> Space:
    """The space that has these `Space.settings`, on the robot of that name.

    Raises InvalidValue if the record is none of a space or of another robot, MobeeError if the space that is made
    now is not the one on record (the robot's limits, or this program, are others).
    """
    kinds: dict[str, type[Space]] = {"lattice": Lattice, "voronoi": Voronoi, "space": Space}
    if not isinstance(settings, Mapping):
        raise InvalidValue(f"{settings!r} is no record of a space: give Space.settings.")
    kind = settings.get("kind", "lattice")
    if kind not in kinds or not {"robot", "digest", "joints"} <= settings.keys():
        raise InvalidValue(f"the record with {', '.join(settings) or 'nothing'} (kind {kind!r}) is none of a space: give Space.settings.")
    if settings["robot"] != robot.name:
        raise InvalidValue(f"the space on record is of robot {settings['robot']!r}, given {robot.name!r}: load that robot.")
    arguments = {name: value for name, value in settings.items() if name not in _OF_A_RECORD}
    if arguments.get("seed", 0) is None:  # samples that were given, not drawn
        del arguments["seed"]
    space = kinds[kind](robot, **arguments)
    if space.settings["digest"] != settings["digest"]:
        raise MobeeError(
            f"the space made from the record ({kind} of {space.part}) has other samples or neighbours than the one recorded "
            f"(digest {space.settings['digest']}, on record {settings['digest']}): use the robot file and the version of then."
        )
    return space
