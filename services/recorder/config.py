# SPDX-License-Identifier: Apache-2.0
"""Settings of the recorder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from mobee.errors import InvalidValue
from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The recorder's settings."""

    run_dir: str = "."
    """Folder in which the recording is written, as files messages-0000.mcap, messages-0001.mcap, ..."""
    largest: Annotated[float, Meta(ge=10, le=1e9)] = 2000.0
    """Largest size of all files of the recording together [MB]. When it is reached, the oldest file is removed."""
    keep_free: Annotated[float, Meta(ge=0, le=1e9)] = 500.0
    """Least free space on the disk [MB]. With less free space nothing is recorded, so that other programs can still write."""
    pose_rate: Annotated[float, Meta(ge=0, le=100)] = 10.0
    """Rate [Hz] of joint states and link transforms as ROS 2 messages, which are recorded for viewers; 0: none."""
    json_rate: Annotated[float, Meta(ge=0, le=100)] = 2.0
    """Largest rate [Hz], for each key, of copies in JSON, which are recorded for viewers. Single events, such as emergency stops, are
    always copied; 0: only these. The messages themselves are all recorded."""
    everything: bool = False
    """Whether to record also the streams that are published only if someone subscribes: clock, states of single parts, poses, contacts,
    pictures."""

    def require_folder(self) -> None:
        """Raise InvalidValue if `run_dir` is no folder."""
        if not Path(self.run_dir).is_dir():
            raise InvalidValue(f"run_dir {self.run_dir} is not a folder: make it, or name another")
