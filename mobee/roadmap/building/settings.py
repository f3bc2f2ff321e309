# SPDX-License-Identifier: Apache-2.0
"""Settings of a roadmap: the search for its poses, and the choice of its edges."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from mobee.errors import InvalidValue, UnknownName
from mobee.roadmap.ik.ngik import METHODS

MAX_TURN = 0.4  # rad: default of `RoadmapSettings.longest`


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Settings of the searches by evolution strategy for the poses (vertices) of a roadmap (thesis Algorithm 4; see docs/roadmaps.md).

    The spacing is the distance between neighbouring vertices in the task space. Raises InvalidValue for a value out of range.

    Attributes:
        delta: decrease of a vertex's expansion weight (1 at first; no search starts from a vertex of weight 0 or less) for each failed
            search that started from the vertex.
        frontier: True: start a search only where a point one spacing away is free, and aim at this point.  False: start from all vertices,
            without an aim, as printed in the thesis.
        predict: True: a search that has an aim begins at a posture extrapolated from the neighbours' postures.  False: at the posture of
            its vertex.
        std: largest standard deviation of a search from a vertex, as a fraction of each motor's range.
        wide_std: standard deviation of a search for the first pose, or where another search has failed, as a fraction of each motor's
            range.
        population: samples per generation; None: 4 + 3 ln(d), rounded down, for d motors that may move.
        patience: factor on the time limit: a search fails after patience * G generations, but not before 100 / m (m: dimension of the task
            space).  G: number of generations within which 3/4 of the recent successful searches found their vertex.  The limit is 30 d
            generations until 8 searches have succeeded, and 4 times as long where another search has failed.
        tries: largest number of failed searches around a point.  After so many failed searches with aims within half a spacing of a point,
            no further search aims at this point.
        searches: number of simultaneous searches.
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


@dataclass(frozen=True, slots=True)
class RoadmapSettings:
    """Settings of `build_roadmap`: the search for poses, and the edges between them.

    Raises InvalidValue or UnknownName for a value that is not valid.

    Attributes:
        method: "nes": evolution strategy, thesis Algorithms 2-4, for any costs and task coordinates.  "least_squares": on a lattice of
            points in the task space, only for task coordinates with derivatives.  "hybrid": least squares if all task coordinates have
            derivatives, then the evolution strategy for the regions in which least squares found no poses.
        neighbours: number of nearest vertices to which each vertex is joined.  None: each vertex is joined to the m nearest of the vertices
            that were found before it; m: dimension of the task space (Algorithm 4).
        longest: edges along which a motor turns by more than this [rad] are left out.  None: no edge is left out.
        margin: distance that every motor keeps from its limits [rad], at most a quarter of its range.  MoBeE's control law pushes motors
            out of the last 10 degrees, so a robot under this law comes to rest only in poses that keep this margin.
        search: settings of the searches by evolution strategy.
    """

    method: Literal["hybrid", "nes", "least_squares"] = "hybrid"
    neighbours: int | None = None
    longest: float | None = MAX_TURN
    margin: float = 0.0
    search: SearchSettings = field(default_factory=SearchSettings)

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UnknownName("method", self.method, METHODS)
        if self.neighbours is not None and self.neighbours < 1:
            raise InvalidValue(f"neighbours {self.neighbours!r}: must be at least 1, or None for the dimension of the task space.")
        if self.longest is not None and not self.longest > 0.0:
            raise InvalidValue(f"longest {self.longest!r} rad: must be above 0, or None for no limit.")
