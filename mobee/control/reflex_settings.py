"""How the reflex of MoBeE 1.0 decides, and how it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mobee.errors import InvalidValue


@dataclass(frozen=True, slots=True, kw_only=True)
class ReflexSettings:
    """Numbers of the reflex; times in s.

    `confirm`: how long a violation must last, in every tick, before it counts; `release`: how long it must be away.
    `brake`: how long the robot brakes before it is rewound; `dead_time`: how long it rests behind the rewinding, before it is judged.
    `pace`: recorded poses that are rewound a tick.  `must_be_clear`: a waypoint that is itself in violation is passed by, and
    control is given back at a clear pose only.
    """

    history: float = 30.0
    confirm: float = 0.03
    release: float = 0.1
    brake: float = 0.1
    dead_time: float = 0.5
    pace: float = 1.0
    must_be_clear: bool = True

    def __post_init__(self) -> None:
        for name in ("confirm", "release", "brake", "dead_time"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InvalidValue(f"reflex {name} {getattr(self, name)} s: must be a finite time, not negative")
        for name in ("history", "pace"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise InvalidValue(f"reflex {name} {getattr(self, name)}: must be finite and above 0")

    @classmethod
    def naive(cls) -> ReflexSettings:
        """As chapter 4.1 describes it: the first violation counts, and control goes back where a waypoint is reached.

        4.4 tells what became of that: oscillation between the two controllers, and recoveries that fail.
        """
        return cls(confirm=0.0, release=0.0, brake=0.0, dead_time=0.0, must_be_clear=False)
