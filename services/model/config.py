# SPDX-License-Identifier: Apache-2.0
"""Settings of the service `model`, which computes contacts and constraint forces."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.config import WorldConfig


class Config(WorldConfig, frozen=True, kw_only=True):
    """The settings of the service `model`, which computes contacts and constraint forces.

    Objects of the world's file with the role target are not loaded, because vision perceives them.
    """

    gains: Literal["default", "derived", "published_2014"] = "published_2014"
    """Name of the set of gains for the constraint forces; the controller must use the same."""
    propagate: Literal["tree", "part"] = "tree"
    """Motors on which a contact acts. tree: all motors between the base of the robot and the contact; part: only those of the touched
    part."""
    contact_forces: bool = True
    """False: contacts are published, but exert no force, for experiments."""
    sigmas: Annotated[float, Meta(ge=0, le=10)] = 2.0
    """Number of standard deviations of a perceived object's position by which its shape is enlarged."""
    ghosts: tuple[str, ...] = ()
    """Names of perceived objects that the robot may touch. They get the role ghost instead of target, and do not repel the robot."""
    calibration: str = ""
    """File of `mobee calibrate`. Its offsets are added to the values of the head's encoders. Empty: none."""
    terms: list[str] = []
    """User-defined terms of the controller; if there are any, contacts are published with the forces, because terms may depend on them."""
