# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """Settings of the script."""

    run_dir: str = ""
    """Folder of the results."""
