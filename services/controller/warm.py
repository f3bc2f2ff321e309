"""Runs every code path of a reach once at start-up, so that the first real reach is not late."""

from __future__ import annotations

import numpy as np

from bus_schema import VERSION, decode, encode, encoding_of
from bus_schema.rpc import ReachFor
from mobee import Controller
from mobee.control import Forces
from mobee.errors import InvalidValue
from mobee.model.contact import links_moved
from mobee.reach import ReachTarget
from mobee.robot.robot import Robot

TICK = 0.01  # s


def warm(law: Controller, robot: Robot) -> None:
    """Begin, step and end a reach of each part with each marker, and read a request for one; then the law is at rest at home."""
    asked = ReachFor(
        v=VERSION, id="0", who="warm", epoch=0, action_id="0", marker="none", object="none", position=[0.0] * 3, radius=1.0, aim="centre"
    )
    decode(ReachFor, encode(asked), encoding_of(ReachFor))
    nothing = np.zeros(len(robot.motors))
    moved = links_moved(robot)
    here = law.model.evaluate(robot.home)
    for part in robot.parts:
        for name, marker in robot.markers.items():
            if marker.link in moved[part]:
                try:
                    law.reach_toward(part, name, ReachTarget(here.position(name)))
                except InvalidValue:  # only motors of weight 0 move it: a request for such a reach is refused
                    continue
                law.step(robot.home, min(TICK, 0.5 * law.max_dt), Forces(**dict.fromkeys(law.force_names, nothing)))
                law.still_nears(part)
                law.end_reach(part)
    law.reset(robot.home)
