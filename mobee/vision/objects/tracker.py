# SPDX-License-Identifier: Apache-2.0
"""Follows several objects: decides which seen position belongs to which track, and when a new object gets a name."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.vision.objects.placing import Placed
from mobee.vision.objects.thing import Thing
from mobee.vision.objects.track import Innovation, Track, TrackSettings

IMPOSSIBLE = 1e6  # cost of a place outside a track's gate


class Tracker:
    """The tracks of all seen objects of the given things (kinds of objects); positions are in the root frame.

    A look is a pair of pictures at one time. The first object of a thing has the thing's name; the next ones have the names NAME_2, NAME_3,
    up to `TrackSettings.most` objects. If all these names are in use, a new track takes the name of an object that was last seen before the
    track began. So an object that was hidden or moved elsewhere keeps its name.
    """

    def __init__(self, things: Sequence[Thing], settings: TrackSettings | None = None) -> None:
        self._things = {thing.name: thing for thing in things}
        self.settings = settings or TrackSettings()
        self._tracks: list[Track] = []
        self._t = -np.inf

    @property
    def tracks(self) -> list[Track]:
        """The tracks of objects that have a name, sorted by name.

        An object gets a name after enough looks (pairs of pictures) have shown it (`TrackSettings.hits`). It is seen at present if `seen`
        of its track is the time of the last look.
        """
        return sorted((track for track in self._tracks if track.name), key=lambda track: track.name)

    def forget(self) -> None:
        """Remove all tracks; called at the start of a new run."""
        self._tracks.clear()
        self._t = -np.inf

    def update(self, t: float, places: Sequence[Placed], turned: float = 0.0) -> None:
        """Update all tracks with the positions seen in one look (a pair of pictures at one time).

        Args:
            t: time of the pictures, s; later than that of the last look.
            places: the things that were seen; may be empty.
            turned: rad by which the gaze has rotated since the last look.

        Raises:
            InvalidValue: the time is not later than that of the last look.
        """
        if t <= self._t:
            raise InvalidValue(f"a look at {t:.3f} s after one at {self._t:.3f} s: looks must be in the order of their times")
        self._t = t
        for thing in self._things.values():
            own = [track for track in self._tracks if track.thing.name == thing.name]
            self._follow(thing, own, [one for one in places if one.name == thing.name], t, turned)
        self._tracks = [track for track in self._tracks if self._is_kept(track)]
        for track in list(self._tracks):
            if not track.name and sum(track.looks) >= self.settings.hits:
                self._name(track)

    def _follow(self, thing: Thing, own: list[Track], places: list[Placed], t: float, turned: float) -> None:
        """Give each place of a thing to the track to which it belongs, or to a new one."""
        found: dict[tuple[int, int], tuple[Innovation, bool]] = {}
        costs: Array = np.full((len(own), len(places)), IMPOSSIBLE)
        for row, track in enumerate(own):
            for column, placed in enumerate(places):
                best = track.best(placed, t, turned)
                if best is not None:
                    found[row, column] = best
                    costs[row, column] = best[0].cost
        taken = {(int(row), int(column)) for row, column in zip(*linear_sum_assignment(costs), strict=True)} & found.keys()
        for row, column in taken:
            own[row].update(places[column], t, *found[row, column])
        for row in set(range(len(own))) - {row for row, _ in taken}:
            own[row].miss(t, turned)
        for column in set(range(len(places))) - {column for _, column in taken}:
            self._tracks.append(Track(thing, places[column], t, self.settings))

    def _is_kept(self, track: Track) -> bool:
        if track.name:
            return track.t - track.seen <= self.settings.forget_after
        possible = sum(track.looks) + (self.settings.of - len(track.looks))
        return possible >= self.settings.hits

    def _name(self, track: Track) -> None:
        """Give a track the first free name of its thing, or that of the object that was not seen since before it; else none."""
        thing = track.thing.name
        names = [thing, *(f"{thing}_{number}" for number in range(2, self.settings.most + 1))]
        taken = {other.name: other for other in self._tracks if other.name and other.thing is track.thing}
        free = [name for name in names if name not in taken]
        hidden = [other for other in taken.values() if other.seen < track.born]
        if free:
            track.name = free[0]
        elif hidden:
            lost = min(hidden, key=lambda other: other.seen)
            track.name = lost.name
            self._tracks.remove(lost)
