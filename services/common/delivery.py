"""The delivery classes: how a message may be lost, and what it may overtake."""

from __future__ import annotations

from dataclasses import dataclass

import zenoh


@dataclass(frozen=True, slots=True)
class Delivery:
    """How a stream travels.  `history`: how many messages a late joiner gets; 0 = none."""

    congestion: zenoh.CongestionControl
    priority: zenoh.Priority
    history: int = 0


_DROP = zenoh.CongestionControl.DROP

LATEST = Delivery(_DROP, zenoh.Priority.REAL_TIME)  # control: the newest value or nothing; never blocks the sender
STEP = Delivery(zenoh.CongestionControl.BLOCK, zenoh.Priority.REAL_TIME)  # control in lockstep: all, in order
STOP = Delivery(zenoh.CongestionControl.BLOCK, zenoh.Priority.REAL_TIME)  # emergency stop: rather late than never
DATA = Delivery(_DROP, zenoh.Priority.DATA)  # perceived objects, ground truth
BULK = Delivery(_DROP, zenoh.Priority.DATA_LOW)  # pictures: behind everything else
EVENTS = Delivery(_DROP, zenoh.Priority.DATA_LOW, history=100)  # what a person reads; late joiners get the last ones
NEWEST = Delivery(_DROP, zenoh.Priority.DATA_LOW, history=1)  # large and slow: late joiners get the last one
