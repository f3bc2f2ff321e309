"""The tag mass: what a link weighs, and where its centre of mass is."""

from __future__ import annotations

from mobee.robot.bodies import from_six
from mobee.robot.robot import Body
from mobee.robot.xml_draft import Draft, Place
from mobee.robot.xml_node import Node
from mobee.robot.xml_volume import PLACE

MASS_ATTRIBUTES = frozenset({"value", "inertia", *PLACE})
HEAVIEST = 1e6  # kg


def read_mass(node: Node, draft: Draft, place: Place) -> None:
    """Add a <mass>; several on one link add up."""
    mass = node.positive("value", unit="kilograms")
    if mass > HEAVIEST:
        node.fail("value", f"{mass:g} is too large", "Masses are in kilograms")
    inertia = from_six(node.numbers("inertia", 6)) if "inertia" in node.attributes else None
    draft.bodies.append(Body(place.link, mass, place.start + node.vector(PLACE), inertia))
