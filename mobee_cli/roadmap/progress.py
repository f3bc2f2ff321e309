# SPDX-License-Identifier: Apache-2.0
"""Publishes the progress of the running robot along a path of a roadmap."""

from __future__ import annotations

from typing import Any

import numpy as np

from bus_schema.messages import Playback, PlaybackPhase
from mobee.arrays import Array
from mobee.roadmap.playback import Reference
from mobee.roadmap.roadmap import Roadmap
from mobee_cli.roadmap.show import marker_of
from services.common.service import Service

PLACES = 100  # of the marker on a path
PERIOD = 200_000_000  # ns of the robot's clock between two messages


class Progress:
    """Publishes a path and how much of it is completed, so that the monitor can show both."""

    def __init__(self, service: Service, trm: Roadmap) -> None:
        self._trm, self._clock = trm, service.bus
        self._publisher = service.bus.publisher(Playback)
        self._fixed: dict[str, Any] = {}  # fields that stay the same during the motion
        self._phase: PlaybackPhase = "interrupted"
        self._share, self._missing, self._next = 0.0, 0.0, 0

    def begin(self, place: Array, wanted: Reference) -> None:
        """Publish that a motion begins. `place`: its goal in the coordinates of the roadmap, (m,). `wanted`: the planned motion."""
        marker = marker_of(self._trm)
        rows = np.linspace(0, len(wanted.q) - 1, min(len(wanted.q), PLACES)).astype(int)
        path = self._trm.model.evaluate(wanted.q[rows]).position(marker)
        self._fixed = {
            "place": self._trm.format_coordinates(place),
            "marker": marker,
            "path": path.tolist(),
            "duration": float(wanted.times[-1]),
        }
        self._missing = float(np.linalg.norm(path[-1] - path[0]))
        self._put("moving")

    def note(self, share: float, q: Array) -> None:
        """Publish the progress of the motion, at most five times per second of robot time.

        `share`: completed part, 0 to 1. `q`: measured pose (n,) rad.
        """
        self._share = share
        if self._clock.t < self._next and share < 1.0:
            return
        self._next = self._clock.t + PERIOD
        position = self._trm.model.evaluate(q).position(self._fixed["marker"])
        self._missing = float(np.linalg.norm(np.array(self._fixed["path"][-1]) - position))
        self._put("moving")

    def rest(self, q: Array) -> None:
        """Publish that the path is completed and the robot rests in the pose `q` (n,) rad."""
        self.note(1.0, q)
        self._phase = "over"

    def end(self) -> None:
        """Publish the end of the motion: it is "over" if `rest` was called before, otherwise "interrupted"."""
        if self._fixed:
            self._put(self._phase)

    def _put(self, phase: PlaybackPhase) -> None:
        self._publisher.put(phase=phase, share=self._share, missing=self._missing, **self._fixed)
