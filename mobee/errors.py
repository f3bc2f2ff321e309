# SPDX-License-Identifier: Apache-2.0
"""Every error this library raises on purpose, under one base class."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence


class MobeeError(Exception):
    """The base class of MoBeE's exceptions. A message states what was given, where, what is valid, and what to do next."""


class RobotFileError(MobeeError):
    """Raised for a robot or world file that cannot be read; the message has file, line, field and remedy."""


class OlderVersion(UserWarning):
    """Warns that an element of a file was read by the rules of an older version of the format."""


class Simplified(UserWarning):
    """Warns that a robot file has an element that this library does not model; the message says how the element is simplified."""


class InvalidValue(MobeeError, ValueError):
    """Raised for an argument with a wrong type, shape or range."""


class UnknownName(MobeeError, KeyError):
    """Raised for an unknown name, e.g. of a motor, object or method; the message has all valid names, and a similar one if there is one."""

    def __init__(self, kind: str, given: object, valid: Iterable[object]) -> None:
        names = sorted(map(str, valid))
        near = difflib.get_close_matches(str(given), names, n=1) or [name for name in names if str(given) and str(given) in name]
        hint = f" Did you mean {near[0]!r}?" if near else ""
        super().__init__(f"unknown {kind} {given!r}.{hint} Valid: {', '.join(names) or 'none'}.")

    def __str__(self) -> str:  # KeyError would print the repr of the message
        return str(self.args[0])


class NotInstalled(MobeeError):
    """Raised if a package or the native core is not installed, or was built for another machine; the message gives the remedy."""


class NoRoom(MobeeError):
    """Raised if the disk refuses a write, because it is full or over quota; the same call succeeds when there is room."""


class InUse(MobeeError):
    """Raised if another process writes the data of the same agent in the same file."""


class ActionInterrupted(MobeeError):
    """Raised if an action ends without an outcome, by a hold (a safe stop), a fault or a restart of the robot; no agent learns from it."""


class BatchInterrupted(ActionInterrupted):
    """Raised if some plants (simulated robots) of a batch were interrupted or failed; the other plants ended normally.

    `results`: the result of each plant, or the exception that ended it, in the order of the plants.
    """

    def __init__(self, results: Sequence[object]) -> None:
        self.results = list(results)
        lost = [number for number, result in enumerate(self.results) if isinstance(result, Exception)]
        super().__init__(
            f"{len(lost)} of {len(self.results)} plants were interrupted, the first plants[{lost[0]}]: {self.results[lost[0]]} "
            "(`results` of this error holds what the others came to)"
        )

    def __reduce__(self) -> tuple[type[BatchInterrupted], tuple[list[object]]]:  # so that it can come from another process
        return BatchInterrupted, (self.results,)
