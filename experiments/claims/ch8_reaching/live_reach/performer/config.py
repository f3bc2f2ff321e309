"""The configuration of the performer."""

from __future__ import annotations

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The performer's settings."""

    run_dir: str = ""
    """Folder of its job and of its record."""
