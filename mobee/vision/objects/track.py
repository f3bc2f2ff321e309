# SPDX-License-Identifier: Apache-2.0
"""Follows several objects, each with a Kalman filter of position, velocity and the cameras' bias, and averages of size and orientation.

`Tracker` decides which seen position belongs to which track, and when a new object gets a name.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.optimize import linear_sum_assignment

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.settings import Range, Settings
from mobee.vision.objects.placing import Placed
from mobee.vision.objects.thing import Thing, upright

P, V, B = slice(0, 3), slice(3, 6), slice(6, 9)  # of the state: position m, velocity m/s, bias m
_SEEN = np.concatenate([np.eye(3), np.zeros((3, 3)), np.eye(3)], axis=1)  # a place is position and bias
LOOKS = 8  # over which size and orientation are averaged at least
IMPOSSIBLE = 1e6  # cost of a place outside a track's gate


@dataclass(frozen=True, kw_only=True)
class TrackSettings(Settings):
    """Settings for tracking objects; a look is a pair of pictures, one from each camera, taken at the same time.

    The position of an object at rest is modelled as a slow random walk; the velocity of a moving object as an Ornstein-Uhlenbeck process
    about 0.

    Args:
        hits: number of looks that must show a new object before it gets a name.
        of: number of latest looks among which these hits must be.
        gate: largest squared Mahalanobis distance (3 dimensions) at which a seen position may belong to a track.
        surprise: squared Mahalanobis distance above which an object at rest is assumed to move.
        wander: m, standard deviation of the drift of an object at rest along each axis after one second.
        speed: m/s, standard deviation of the velocity of a moving object along each axis.
        persistence: time constant of velocities, s.
        moves_for: s, time for which an object that has moved counts as moving.
        turn: rad, rotation of the gaze after which the bias of the cameras has mostly changed.
        forget_after: s, time after which an object that was not seen again loses its name.
        most: largest number of objects of each `Thing` (kind of object, with shape, size and colour) that get a name.
    """

    hits: Annotated[int, Range(ge=1, le=100)] = 3
    of: Annotated[int, Range(ge=1, le=100)] = 5
    gate: Annotated[float, Range(gt=0.0)] = 16.3
    surprise: Annotated[float, Range(gt=0.0)] = 16.3
    wander: Annotated[float, Range(gt=0.0, le=1.0)] = 0.001
    speed: Annotated[float, Range(gt=0.0, le=10.0)] = 0.25
    persistence: Annotated[float, Range(gt=0.0, le=10.0)] = 0.5
    moves_for: Annotated[float, Range(ge=0.0, le=60.0)] = 1.0
    turn: Annotated[float, Range(gt=0.0, le=7.0)] = 0.3
    forget_after: Annotated[float, Range(gt=0.0, le=3600.0)] = 60.0
    most: Annotated[int, Range(ge=1, le=100)] = 1


@dataclass(frozen=True, slots=True, eq=False)
class Innovation:
    """A seen position compared with the prediction of a track.

    `difference`: (3,) m, seen minus predicted position. `covariance`: (3, 3) m^2, of the difference. `mean`: (9,), the predicted state:
    position [m], velocity [m/s] and bias [m]. The bias is the error of seen positions that stays the same while the gaze does not change.
    `spread`: (9, 9), covariance of the state.
    """

    difference: Array
    covariance: Array
    mean: Array
    spread: Array

    @property
    def distance(self) -> float:
        """The squared Mahalanobis distance of the seen position from the prediction."""
        return float(self.difference @ np.linalg.solve(self.covariance, self.difference))

    @property
    def cost(self) -> float:
        """Twice the negative logarithm of the likelihood of the seen position, up to a constant."""
        return self.distance + float(np.linalg.slogdet(self.covariance)[1])


class Track:
    """An object that is followed from look to look; a look is a pair of pictures, one from each camera, taken at the same time.

    `name`: unique; empty until enough looks have shown the object (`TrackSettings.hits`). `born`: time [s] of the first look. `t`: time [s]
    of the newest look. `seen`: time [s] of the newest look that showed the object. `looks`: whether each of the latest looks showed the
    object.
    """

    def __init__(self, thing: Thing, first: Placed, t: float, settings: TrackSettings) -> None:
        self.thing, self.name, self.born, self.t, self.seen = thing, "", t, t, t
        self._settings = settings
        self._mean = np.concatenate([first.position, np.zeros(6)])
        self._spread = np.zeros((9, 9))
        self._spread[P, P] = first.covariance
        self._spread[V, V] = settings.speed**2 * np.eye(3)
        self._spread[P, B] = self._spread[B, P] = -first.bias
        self._spread[B, B] = first.bias
        self._bias = first.bias
        self._moving_until = t + settings.moves_for  # it may have been put there just now
        self._size, self._information = first.size.copy(), first.size_deviation**-2.0
        self._yaw, self._looks = _yaw_of(first.rotation), 1
        self.looks: deque[bool] = deque([True], maxlen=settings.of)

    @property
    def position(self) -> Array:
        """The position (3,) m at time `t`, root frame."""
        return self._mean[P].copy()

    @property
    def velocity(self) -> Array:
        """The velocity (3,) m/s at time `t`, root frame."""
        return self._mean[V].copy()

    @property
    def covariance(self) -> Array:
        """The covariance (3, 3) m^2 of the position at time `t`, along the axes of the root frame."""
        return self._spread[P, P].copy()

    @property
    def rotation(self) -> Array:
        """The rotation (3, 3) of the shape's axes in the root frame: a turn about the vertical z axis, averaged over the looks.

        A look is a pair of pictures, one from each camera, taken at the same time.
        """
        return upright(self._yaw)

    @property
    def size(self) -> Array:
        """The g lengths (g,) m of the shape, in the order of `Thing.size`, averaged over the looks (pairs of pictures of the same time)."""
        return self._size.copy()

    @property
    def is_moving(self) -> bool:
        """Whether the object moves or moved a short time ago (`TrackSettings.moves_for`)."""
        return self.t <= self._moving_until

    def innovation(self, placed: Placed, t: float, turned: float, moving: bool) -> Innovation:
        """Compare a seen position at time t [s] with the prediction of the track.

        `turned`: angle [rad] by which the gaze has rotated since the last look (pair of pictures). `moving`: predict for a moving object,
        else for one at rest.
        """
        mean, spread = self._predicted(t, turned, moving)
        covariance = _SEEN @ spread @ _SEEN.T + placed.noise
        return Innovation(placed.position - _SEEN @ mean, covariance, mean, spread)

    def best(self, placed: Placed, t: float, turned: float) -> tuple[Innovation, bool] | None:
        """Compare a position seen at time t [s] with the prediction; return the comparison, and whether it assumes a moving object.

        The prediction for an object at rest is used if the object no longer counts as moving (`TrackSettings.moves_for`) and the squared
        Mahalanobis distance from this prediction is at most `TrackSettings.surprise`. Otherwise the prediction for a moving object is used;
        return None if the distance from it is above `TrackSettings.gate`. `placed`: the seen position. `turned`: angle [rad] by which the
        gaze has rotated since the last look (pair of pictures).
        """
        if t > self._moving_until:
            rest = self.innovation(placed, t, turned, moving=False)
            if rest.distance <= self._settings.surprise:
                return rest, False
        moving = self.innovation(placed, t, turned, moving=True)
        return (moving, True) if moving.distance <= self._settings.gate else None

    def update(self, placed: Placed, t: float, found: Innovation, moved: bool) -> None:
        """Update the track with a seen position at time t [s].

        `found`: the comparison of the position with the prediction. `moved`: whether the prediction was that for a moving object. Both are
        returned by `best`.
        """
        gain = np.linalg.solve(found.covariance, _SEEN @ found.spread).T
        self._mean = found.mean + gain @ found.difference
        keep = np.eye(9) - gain @ _SEEN
        self._spread = keep @ found.spread @ keep.T + gain @ placed.noise @ gain.T
        if moved and t > self._moving_until:
            self._looks = 1  # it may have been turned
        if moved and (t > self._moving_until or self._has_speed()):
            self._moving_until = t + self._settings.moves_for
        self.t = self.seen = t
        self._bias = placed.bias
        self._average(placed)
        self.looks.append(True)

    def miss(self, t: float, turned: float) -> None:
        """Predict the track to time t [s], at which a pair of pictures (a look) did not show the object.

        `turned`: angle [rad] by which the gaze has rotated since the last look.
        """
        self._mean, self._spread = self._predicted(t, turned, self.is_moving)
        self.t = t
        self.looks.append(False)

    def _predicted(self, t: float, turned: float, moving: bool) -> tuple[Array, Array]:
        """Return the predicted state (9,) and its covariance (9, 9) at time t [s]: position [m], velocity [m/s] and bias [m].

        The bias is the error of seen positions that changes only with the gaze. `turned`: angle [rad] by which the gaze has rotated since
        the last pictures. `moving`: predict for a moving object, else for one at rest.
        """
        settings = self._settings
        dt, tau = max(0.0, t - self.t), settings.persistence
        same = float(np.exp(-abs(turned) / settings.turn))
        step, added = np.eye(9), np.zeros((9, 9))
        step[B, B] *= same
        added[B, B] = (1.0 - same**2) * self._bias
        if moving:
            stay = float(np.exp(-dt / tau))
            step[P, V], step[V, V] = tau * (1.0 - stay) * np.eye(3), stay * np.eye(3)
            square = settings.speed**2
            added[P, P] = square * tau * (2.0 * dt - tau * (3.0 - 4.0 * stay + stay**2)) * np.eye(3)
            added[P, V] = added[V, P] = square * tau * (1.0 - stay) ** 2 * np.eye(3)
            added[V, V] = square * (1.0 - stay**2) * np.eye(3)
        else:
            step[V, V] = 0.0
            added[P, P] = settings.wander**2 * dt * np.eye(3)
            added[V, V] = settings.speed**2 * np.eye(3)  # if it begins to move
        return step @ self._mean, step @ self._spread @ step.T + added

    def _has_speed(self) -> bool:
        velocity = self._mean[V]
        return float(velocity @ np.linalg.solve(self._spread[V, V], velocity)) > self._settings.surprise

    def _average(self, placed: Placed) -> None:
        """Average the size and yaw of a new seen position with the earlier ones, and store the averages in the track.

        The new yaw has the weight 1 / n; n: number of seen positions so far, at most LOOKS. The sizes are weighted by their variances. A
        box that is turned by 90 deg, with its sides exchanged, is the same box, so the description nearest to the average is used.
        """
        size, yaw = placed.size, _yaw_of(placed.rotation)
        if self.thing.kind == "box":
            turns = int(np.round((self._yaw - yaw) / (0.5 * np.pi)))
            yaw += turns * 0.5 * np.pi
            size = size[[1, 0, 2]] if turns % 2 else size
        self._looks += 1
        self._yaw += (yaw - self._yaw) / min(self._looks, LOOKS)
        weight = placed.size_deviation**-2.0
        self._information = np.minimum(self._information, (LOOKS - 1) * weight) + weight
        self._size = self._size + weight / self._information * (size - self._size)


def _yaw_of(rotation: Array) -> float:
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))


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
            InvalidValue: the time is not later than that of the last look, or a number is not finite; then nothing changes.
        """
        if not (np.isfinite([t, turned]).all() and all(np.isfinite(one.position).all() for one in places)):
            raise InvalidValue(f"a look at {t} s, turned by {turned} rad, at {[one.position.tolist() for one in places]} m: must be finite")
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
        """Update each track of a kind of thing with the seen position that belongs to it; a position without a track starts a new one.

        `own`: the tracks of this thing. `places`: seen positions, assigned to tracks such that the sum of the costs is the smallest. A
        track without a position has missed it (`Track.miss`). `t`: time of the pictures [s]. `turned`: angle [rad] by which the gaze has
        rotated since the last pictures.
        """
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
        """Give a track, which has no name yet, the first free name of its kind of thing ("ball", "ball_2", ...).

        If no name is free, the track takes the name of another track and replaces it: the one whose last sight is the oldest, if this was
        before the first sight of the new track. If there is no such track, the new one remains without a name.
        """
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
