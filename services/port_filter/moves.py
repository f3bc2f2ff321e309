"""Detects when a client begins a motion: its reference leaves rest."""

from __future__ import annotations

from bus_schema.messages import Command

REST = 0.1  # s for which a reference has stayed the same before it is said to rest


class Moves:
    """Watches the commands of one part."""

    def __init__(self) -> None:
        self._reference: list[float] | None = None  # of position commands; None: the part was commanded otherwise, or not at all
        self._since = 0  # ns, when the reference became what it is
        self._moving = False

    def begins(self, command: Command, t: int) -> bool:
        """Whether this command begins a position move; t ns of the bus clock."""
        if command.mode != "position":
            self._reference, self._moving = None, False
            return False
        if command.ref == self._reference:
            self._moving = self._moving and t - self._since < REST * 1e9
            return False
        begins = not self._moving
        self._reference, self._since, self._moving = command.ref, t, True
        return begins

    def forget(self) -> None:
        """The part is out of the client's hands."""
        self._reference, self._moving = None, False
