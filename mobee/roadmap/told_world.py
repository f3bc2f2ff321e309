"""A world as plain JSON, so that a map carries the one it was made in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mobee.collision.geometry import Geometry
from mobee.collision.world import World


def world_told(world: World) -> list[dict[str, Any]]:
    """Its objects, in the order in which they were added."""
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
        }
        for one in world.objects.values()
    ]


def told_world(objects: Sequence[dict[str, Any]]) -> World:
    """A new world of them; raises KeyError and InvalidValue for what is none."""
    world = World()
    for one in objects:
        place = {"position": one["position"], "rotation": one["rotation"]}
        shape = Geometry(one["kind"], tuple(one["size"]))
        if one["link"] is None:
            world.add(one["name"], shape, role=one["role"], color=one["color"], **place)
        else:
            world.add(one["name"], shape, role=one["role"], color=one["color"])
            world.attach(one["name"], one["link"], (one["position"], one["rotation"]))
    return world
