# SPDX-License-Identifier: Apache-2.0
"""The egocentric model (in the robot's own root frame): link poses, contacts, and contact forces in joint space (thesis chapter 2)."""

from mobee.model.contact import Contact
from mobee.model.world import World, WorldObject
from mobee.model.world_object import Geometry, box, capsule, cylinder, sphere

__all__ = ["Contact", "Geometry", "World", "WorldObject", "box", "capsule", "cylinder", "sphere"]
