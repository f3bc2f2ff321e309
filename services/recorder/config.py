# SPDX-License-Identifier: Apache-2.0
"""Settings of the recorder."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The recorder's settings."""

    run_dir: str = "."
    """Folder of the files messages-0000.mcap, messages-0001.mcap, ..."""
    largest: Annotated[float, Meta(ge=10)] = 2000.0
    """Largest size of all files together, MB; beyond it the oldest file is removed."""
    keep_free: Annotated[float, Meta(ge=0)] = 500.0
    """Free space of the disk, MB, below which nothing is recorded, so that the others can still write."""
    pose_rate: Annotated[float, Meta(ge=0, le=100)] = 10.0
    """Joint states and transforms for viewers, Hz; 0: none."""
    json_rate: Annotated[float, Meta(ge=0, le=100)] = 2.0
    """Largest rate of copies in JSON for viewers, on each key, Hz; 0: none. The messages themselves are all recorded."""
    everything: bool = False
    """Whether to record also streams that are published for subscribers only: clock, states of single parts, poses, contacts, pictures."""
