# SPDX-License-Identifier: Apache-2.0
"""What the probe and its tests share: a struct of the main module cannot be named by another."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta

from bus_schema.messages import Geometry
from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """A few kinds of fields."""

    orphaned: float = 10.0
    """Seconds without a router."""
    inject_test_delay: float = 0.0
    """Seconds spent on every object."""
    gains: Literal["default", "published_2014"] = "default"
    """A word out of few."""
    share: Annotated[float, Meta(gt=0, le=1)] = 0.5
    """A bounded number."""
    posture: dict[str, list[float]] = {}
    """A table."""


PROBE = ("-m", "tests.services.common.probe")  # arguments of Python


def ball(publisher: Any, name: str = "ball") -> None:
    publisher.put(
        name=name,
        geometry=Geometry(kind="sphere", size=[0.03]),
        position=[0.0, 0.0, 0.0],
        quaternion=[1.0, 0.0, 0.0, 0.0],
        covariance=[0.0] * 9,
        role="target",
        t_capture=0,
        valid_until=0,
    )
