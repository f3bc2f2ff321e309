# SPDX-License-Identifier: Apache-2.0
"""Settings of the performer."""

from __future__ import annotations

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The performer's settings."""

    perform: str = ""
    """The function to call with the service and the folder of the job, as "package.module:function"."""
    run_dir: str = ""
    """Folder of the job and of the results."""
