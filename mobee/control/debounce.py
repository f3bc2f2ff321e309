"""A filter for judgements that noise makes flicker (thesis 4.4)."""

from __future__ import annotations


class Debounce:
    """A signal that changes only after the raw one has said the same for some ticks without a break."""

    def __init__(self, confirm: int, release: int) -> None:
        """Ticks until it becomes true, and until it becomes false; at least 1 each."""
        self._needed = {True: max(confirm, 1), False: max(release, 1)}
        self._ticks = 0  # for which the raw signal has differed
        self.on = False

    def update(self, raw: bool) -> bool:
        """One tick of the raw signal; the filtered one."""
        self._ticks = self._ticks + 1 if raw != self.on else 0
        if self._ticks >= self._needed[raw]:
            self.on, self._ticks = raw, 0
        return self.on
