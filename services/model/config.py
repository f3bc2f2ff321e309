# SPDX-License-Identifier: Apache-2.0
"""Settings of the model."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.config import WorldConfig


class Config(WorldConfig, frozen=True, kw_only=True):
    """The model's settings; world objects with the role target are not loaded, because vision perceives them."""

    gains: Literal["default", "derived", "published_2014"] = "published_2014"
    """Name of the set of gains for the constraint forces; the controller must use the same."""
    propagate: Literal["tree", "part"] = "tree"
    """Motors on which a contact acts: all between the body's root and the contact, or those of the touched part only."""
    contact_forces: bool = True
    """False: contacts are published but exert no force, for experiments without that force."""
    sigmas: Annotated[float, Meta(ge=0, le=10)] = 2.0
    """Standard deviations of a perceived object's position by which its shape is enlarged."""
    ghosts: tuple[str, ...] = ()
    """Perceived objects that the robot may touch: they have the role ghost, in place of target, and do not repel it."""
    calibration: str = ""
    """File of `mobee calibrate`, whose offsets of the head's encoders are added to what they report; empty: none."""
    terms: list[str] = []
    """User-defined terms of the controller; if there are any, contacts are published with the forces, because terms may depend on them."""
