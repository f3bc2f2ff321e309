# SPDX-License-Identifier: Apache-2.0
"""Settings of the monitor."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.cameras import CameraConfig

Port = Annotated[int, Meta(gt=0, lt=65536)]


class Config(CameraConfig, frozen=True, kw_only=True):
    """The monitor's settings."""

    serve: bool = True
    """Whether a page is served; a recording is made in any case when there is a run_dir."""
    bind: Literal["127.0.0.1", "0.0.0.0"] = "127.0.0.1"
    """Address the page is served at; every interface only inside a container whose ports are published on loopback."""
    web_port: Port = 9090
    """Port of the page."""
    run_dir: str = ""
    """Folder for recording.rrd and story.jsonl; empty: no recording."""
    rate: Annotated[float, Meta(ge=1, le=20)] = 20.0
    """Updates of the robot a second."""
    image_rate: Annotated[float, Meta(gt=0, le=10)] = 2.0
    """Pictures of each camera shown a second."""
