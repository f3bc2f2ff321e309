"""What only the simulator knows, tick by tick, in files: for experiments that judge what a robot did."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from mobee.collision.world import World
from mobee.errors import InvalidValue
from mobee.simulation.motors import Motors
from services.robot_sim.backend import Backend, SolidContact

POSITIONS = "q.f64"  # a row of n float64 [rad] a tick, the first at the end of tick 1
CONTACTS = "contacts.csv"  # tick, pair, depth [m]; nothing for a tick without contact


class Recorded:
    """A back-end that keeps the joint positions, without noise, and the solid contacts of every tick.

    Both files begin anew with every run; what was written is in them even when the process is killed.
    """

    def __init__(self, inner: Backend, folder: Path) -> None:
        """Raises InvalidValue for a folder that cannot be written."""
        self._inner = inner
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._positions = (folder / POSITIONS).open("wb", buffering=0)
            self._contacts = (folder / CONTACTS).open("w", buffering=1)
        except OSError as error:
            raise InvalidValue(f"record: cannot write {error.filename} ({error.strerror})") from None
        self.pairs_watched = inner.pairs_watched
        self._begin()

    @property
    def motors(self) -> Motors:
        """See Backend."""
        return self._inner.motors

    @property
    def world(self) -> World:
        """See Backend."""
        return self._inner.world

    def step(self, dt: float) -> None:
        """See Backend."""
        self._inner.step(dt)
        self._k += 1
        self._positions.write(self._inner.motors.q.tobytes())
        for pair, depth in self._inner.contacts().items():
            self._contacts.write(f"{self._k},{pair},{depth:.6g}\n")

    def reset(self, seed: int) -> None:
        """See Backend."""
        self._inner.reset(seed)
        self._begin()

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """See Backend."""
        self._inner.place(name, position)

    def contact(self) -> SolidContact:
        """See Backend."""
        return self._inner.contact()

    def contacts(self) -> Mapping[str, float]:
        """See Backend."""
        return self._inner.contacts()

    def gap(self) -> float:
        """See Backend."""
        return self._inner.gap()

    def _begin(self) -> None:
        self._k = 0
        for file in (self._positions, self._contacts):
            file.seek(0)
            file.truncate()
        self._contacts.write("k,pair,depth\n")
