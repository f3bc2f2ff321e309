"""What the controller is told."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The controller's settings."""

    gains: Literal["default", "published_2014"] = "published_2014"
    """Which set of gains; the model must use the same."""
    modality: Literal["position", "velocity", "torque"] = "velocity"
    """What the motors are commanded."""
    speed_scale: Annotated[float, Meta(gt=0, le=1)] = 1.0
    """Share of the motors' top speed that is used."""
    ttl: Annotated[int, Meta(ge=20, le=200)] = 100
    """Milliseconds after which robot_sim holds a part that it hears nothing for."""
    posture: dict[str, list[float]] = {}
    """Where a part that nobody owns shall be, rad, by part; a part that is not named stays where it is."""
