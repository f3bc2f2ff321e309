"""Forces of a client that drive the robot into the table, its own body and its joint limits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mobee import Controller

Push = Callable[[Controller, float], None]  # N/kg at a marker, rad/s^2 at a motor; before the squash


def _marker(marker: str, direction: tuple[float, float, float]) -> Push:
    return lambda controller, force: controller.push(marker, force * np.array(direction))


def _both(x: float, y: float, z: float) -> Push:
    """Both hands, mirrored."""

    def push(controller: Controller, force: float) -> None:
        controller.push("left_palm", force * np.array([x, y, z]))
        controller.push("right_palm", force * np.array([x, -y, z]))

    return push


def _motors(part: str, sign: float) -> Push:
    def push(controller: Controller, force: float) -> None:
        f = np.zeros(len(controller.robot.motors))
        f[controller.robot.parts[part].slice] = sign * force
        controller.force(f)

    return push


def _together(*pushes: Push) -> Push:
    """At markers and at motors at once."""

    def push(controller: Controller, force: float) -> None:
        for each in pushes:
            each(controller, force)

    return push


# Root frame: x backwards, y right, z up.
PUSHES: dict[str, Push] = {
    "table-left-hand": _marker("left_palm", (0.0, 0.0, -1.0)),
    "table-right-hand": _marker("right_palm", (0.0, 0.0, -1.0)),
    "table-both-hands": _both(0.0, 0.0, -1.0),
    "table-edge": _marker("left_palm", (0.7, 0.0, -0.7)),
    "chest": _marker("left_palm", (1.0, 0.2, 0.0)),
    "other-hand": _both(0.0, 1.0, 0.0),
    "face": _marker("right_palm", (0.7, -0.5, 0.5)),
    "limits-arm+": _motors("left_arm", 1.0),
    "limits-arm-": _motors("left_arm", -1.0),
    "limits-torso+": _motors("torso", 1.0),
    "limits-torso-": _motors("torso", -1.0),
    "table-hand-and-torso": _together(_marker("left_palm", (0.0, 0.0, -1.0)), _motors("torso", 1.0)),
    "limits-hand-and-arm": _together(_marker("left_palm", (0.0, 0.0, 1.0)), _motors("left_arm", 1.0)),
}
