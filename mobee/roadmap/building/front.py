"""Settings of an advancing front."""

from __future__ import annotations

from dataclasses import dataclass

from mobee.errors import InvalidValue


@dataclass(frozen=True, slots=True)
class Front:
    """Settings of thesis Algorithm 4, and what makes it end and makes it fast (docs/roadmaps.md says what each does).

    `delta`: what a vertex's expansion weight of 1 falls by when a search from it fails.  `frontier`: search only where a place one
    spacing away is free, and aim at it; False: from all vertices, to anywhere, as printed.  `predict`: with an aim, begin where the
    postures of the neighbours lead to, and as wide as that is far; False: at the vertex.  `std`: standard deviation of a search from a
    vertex, at most, and `wide_std` of one for the first pose or where another has failed, in ranges of the motors.  `population`:
    samples a generation; None: 4 + 3 ln(d).  `patience`: a search has failed after so many times the generations in which three
    quarters of the last ones have succeeded.  `tries`: failures about a place, within half a spacing, after which it is taken for out
    of reach.  `searches`: how many go on at once.
    """

    delta: float = 0.5
    frontier: bool = True
    predict: bool = True
    std: float = 0.02
    wide_std: float = 0.2
    population: int | None = None
    patience: float = 3.0
    tries: int = 3
    searches: int = 32

    def __post_init__(self) -> None:
        """Check it; raises InvalidValue."""
        if not 0.0 < self.delta <= 1.0:
            raise InvalidValue(f"delta {self.delta!r}: must be above 0 and at most 1.")
        for name in ("std", "wide_std"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InvalidValue(f"{name} {getattr(self, name)!r}: must be above 0 and at most 1, in ranges of the motors.")
        if self.population is not None and self.population < 4:
            raise InvalidValue(f"population {self.population!r}: must be at least 4, or None.")
        for name in ("patience", "tries", "searches"):
            if getattr(self, name) < 1:
                raise InvalidValue(f"{name} {getattr(self, name)!r}: must be at least 1.")
