"""Settings of the model."""

from __future__ import annotations

from typing import Literal

from services.common.config import WorldConfig


class Config(WorldConfig, frozen=True, kw_only=True):
    """The model's settings; objects of its world that have the role target are left to be perceived."""

    gains: Literal["default", "published_2014"] = "published_2014"
    """Which set shapes the constraint forces; the controller must use the same."""
    propagate: Literal["tree", "part"] = "tree"
    """How far down the body a contact is felt."""
    contact_forces: bool = True
    """False: contacts are reported but exert no force, as a control experiment."""
    terms: list[str] = []
    """Those of the controller: it is told the contacts, on which they may depend."""
