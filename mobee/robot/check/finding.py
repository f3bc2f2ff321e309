"""One thing that is wrong with a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True, slots=True)
class Finding:
    """What is wrong, where, why it matters and what to do.

    error: the robot cannot work as it is; warning: it will surprise its owner; note: good to know, may well be meant.
    """

    severity: Severity
    check: str  # short name of the check
    where: str  # "file:line"
    what: str
    why: str
    remedy: str
