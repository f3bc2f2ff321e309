"""Settings of the performer."""

from __future__ import annotations

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The performer's settings."""

    perform: str = ""
    """The function that it calls with its service and the folder of its job, as "package.module:function"."""
    run_dir: str = ""
    """Folder of its job and its results."""
