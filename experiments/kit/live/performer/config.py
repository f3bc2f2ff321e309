# SPDX-License-Identifier: Apache-2.0
"""Settings of the performer, a service that calls a function of an experiment."""

from __future__ import annotations

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The settings of the performer (a service that calls a function of an experiment), besides those of every service."""

    perform: str = ""
    """The function to call, as "package.module:function"; its arguments are the service and the folder of the job."""
    run_dir: str = ""
    """Folder of the job, and of the results of the function."""
