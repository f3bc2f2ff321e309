# SPDX-License-Identifier: Apache-2.0
"""Settings of the monitor, the service that shows the running system on a web page."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.cameras import CameraConfig

Port = Annotated[int, Meta(gt=0, lt=65536)]


class Config(CameraConfig, frozen=True, kw_only=True):
    """The monitor's settings."""

    serve: bool = True
    """Whether to serve a page. A recording is written whenever `run_dir` is set, with or without a page."""
    bind: Literal["127.0.0.1", "0.0.0.0"] = "127.0.0.1"
    """Address at which the page is served. Use 0.0.0.0 (all network interfaces) only in a container whose ports are published on
    loopback."""
    web_port: Port = 9090
    """TCP port of the page."""
    run_dir: str = ""
    """Folder in which recording.rrd (3D view) and story.jsonl (values of the page) are written. Empty: nothing is recorded."""
    rate: Annotated[float, Meta(ge=1, le=20)] = 20.0
    """Number of updates of the robot in the 3D view per second."""
    image_rate: Annotated[float, Meta(gt=0, le=10)] = 2.0
    """Number of pictures per second that are shown of each camera."""
