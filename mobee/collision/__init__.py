"""Shapes, the objects of the world, and what touches what."""

from mobee.collision.contact import Contact
from mobee.collision.geometry import Geometry, box, capsule, cylinder, sphere
from mobee.collision.world import World, WorldObject

__all__ = ["Contact", "Geometry", "World", "WorldObject", "box", "capsule", "cylinder", "sphere"]
