# SPDX-License-Identifier: Apache-2.0
"""Tracks: honest covariances, names that stay through crossings and occlusions, and none from clutter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee import InvalidValue
from mobee.vision.objects.placing import Placed
from mobee.vision.objects.thing import Thing
from mobee.vision.objects.track import Track, Tracker, TrackSettings
from tests.mobee.vision.objects.drawn import BALL, BOX, CUP, THINGS, placed

RATE = 15.0  # Hz
NOISE, BIAS = 0.003**2 * np.diag([1.0, 0.3, 1.0]), 0.002**2 * np.eye(3)
TWO = TrackSettings(most=2)
AT = np.array([-0.35, 0.0, -0.05])


def drawn(rng: np.random.Generator, covariance: np.ndarray) -> np.ndarray:
    return rng.multivariate_normal(np.zeros(3), covariance)


def look(thing: Thing, at: np.ndarray, rng: np.random.Generator, bias: np.ndarray | None = None) -> Placed:
    return placed(thing, at + drawn(rng, NOISE) + (0.0 if bias is None else bias), NOISE, BIAS)


def run(tracker: Tracker, paths: dict[int, tuple[Thing, np.ndarray]], rng: np.random.Generator, start: float = 0.0) -> None:
    """Show things that move along paths (T, 3); where a path is NaN the thing is not seen."""
    steps = len(next(iter(paths.values()))[1])
    for step in range(steps):
        seen = [look(thing, path[step], rng) for thing, path in paths.values() if np.isfinite(path[step]).all()]
        rng.shuffle(seen)  # type: ignore[arg-type]
        tracker.update(start + step / RATE, seen)


def line(start: tuple[float, ...], end: tuple[float, ...], steps: int) -> np.ndarray:
    return np.linspace(start, end, steps)


@pytest.mark.parametrize("moving", [False, True])
def test_innovations_and_errors_are_as_large_as_their_covariances(moving: bool, rng: np.random.Generator) -> None:
    """Normalised squares of things that move as the filter assumes, with a gaze that turns: their means are 3, within 10 %."""
    chosen = TrackSettings(moves_for=60.0 if moving else 0.0, surprise=1e6, gate=1e9)
    speed, tau, dt = chosen.speed, chosen.persistence, 1.0 / RATE
    innovations, errors = [], []
    for _ in range(60):
        at, velocity, bias = AT.copy(), speed * rng.standard_normal(3), drawn(rng, BIAS)
        track = Track(BALL, look(BALL, at, rng, bias), 0.0, chosen)
        for step in range(1, 40):
            turned = 0.1 * rng.uniform()
            stay, same = np.exp(-dt / tau), np.exp(-turned / chosen.turn)
            if moving:
                at, velocity = at + velocity * tau * (1.0 - stay), stay * velocity
                push = np.array(
                    [[tau * (2 * dt - tau * (3 - 4 * stay + stay**2)), tau * (1 - stay) ** 2], [tau * (1 - stay) ** 2, 1 - stay**2]]
                )
                shift = rng.multivariate_normal(np.zeros(2), speed**2 * push, size=3)
                at, velocity = at + shift[:, 0], velocity + shift[:, 1]
            else:
                at = at + chosen.wander * np.sqrt(dt) * rng.standard_normal(3)
            bias = same * bias + drawn(rng, (1.0 - same**2) * BIAS)
            seen = look(BALL, at, rng, bias)
            found = track.best(seen, step * dt, turned)
            assert found is not None
            innovations.append(found[0].distance)
            track.update(seen, step * dt, *found)
            error = track.position - at
            errors.append(error @ np.linalg.solve(track.covariance, error))
    assert np.mean(innovations) == pytest.approx(3.0, rel=0.1)
    assert np.mean(errors) == pytest.approx(3.0, rel=0.25)  # successive ones are not independent


def test_a_bias_is_not_averaged_away_while_the_gaze_rests(rng: np.random.Generator) -> None:
    tracker, bias = Tracker(THINGS), np.array([0.002, 0.0, 0.001])
    for step in range(300):
        tracker.update(step / RATE, [look(BALL, AT, rng, bias)])
    (track,) = tracker.tracks
    np.testing.assert_allclose(track.position, AT + bias, atol=0.0015)
    assert np.linalg.eigvalsh(track.covariance - 0.9 * BIAS).min() > 0.0
    assert np.trace(track.covariance) < 1.5 * np.trace(BIAS) < np.trace(BIAS + NOISE)


@given(st.integers(0, 2**31), st.floats(0.03, 0.2))
@settings(max_examples=20, deadline=None)
def test_two_balls_that_cross_keep_their_names(seed: int, apart: float) -> None:
    """They pass each other at 0.15 m/s or more, by several deviations."""
    rng, tracker, steps = np.random.default_rng(seed), Tracker(THINGS, TWO), 30
    still = (line((-0.3, -0.2, 0.0), (-0.3, -0.2, 0.0), 20), line((-0.3, 0.2, apart), (-0.3, 0.2, apart), 20))
    one = np.concatenate([still[0], line((-0.3, -0.2, 0.0), (-0.3, 0.2, 0.0), steps)])
    other = np.concatenate([still[1], line((-0.3, 0.2, apart), (-0.3, -0.2, apart), steps)])
    run(tracker, {0: (BALL, one[:20]), 1: (BALL, other[:20])}, rng)
    before = {track.name: track.position for track in tracker.tracks}
    assert before.keys() == {"ball", "ball_2"}
    run(tracker, {0: (BALL, one[20:]), 1: (BALL, other[20:])}, rng, 20 / RATE)
    for track in tracker.tracks:
        assert track.seen == track.t
        np.testing.assert_allclose(track.position, (1.0, -1.0, 1.0) * before[track.name], atol=0.02)


@given(st.integers(0, 2**31), st.integers(1, 90))
@settings(max_examples=20, deadline=None)
def test_a_hidden_object_keeps_its_name_and_becomes_less_certain(seed: int, hidden: int) -> None:
    rng, tracker = np.random.default_rng(seed), Tracker(THINGS)
    cup = np.array([-0.3, 0.1, -0.05])
    run(tracker, {0: (BALL, np.tile(AT, (40, 1))), 1: (CUP, np.tile(cup, (40, 1)))}, rng)
    sure = {track.name: np.trace(track.covariance) for track in tracker.tracks}
    run(tracker, {0: (BALL, np.full((hidden, 3), np.nan)), 1: (CUP, np.tile(cup, (hidden, 1)))}, rng, 40 / RATE)
    ball, other = tracker.tracks
    assert (ball.name, other.name) == ("ball", "cup")
    assert ball.t - ball.seen == pytest.approx(hidden / RATE) and other.seen == other.t
    assert np.trace(ball.covariance) > sure["ball"] and (other.is_moving or np.trace(other.covariance) < 1.2 * sure["cup"])
    run(tracker, {0: (BALL, np.tile(AT, (5, 1))), 1: (CUP, np.tile(cup, (5, 1)))}, rng, (40 + hidden) / RATE)
    assert [track.name for track in tracker.tracks] == ["ball", "cup"]
    assert tracker.tracks[0].seen == tracker.tracks[0].t


def test_objects_that_change_places_keep_their_names(rng: np.random.Generator) -> None:
    """Their kinds are seen; the new places count after some looks, and until then the old ones become old."""
    tracker, cup = Tracker(THINGS), np.array([-0.3, 0.12, -0.05])
    run(tracker, {0: (BALL, np.tile(AT, (30, 1))), 1: (CUP, np.tile(cup, (30, 1)))}, rng)
    run(tracker, {0: (BALL, np.tile(cup, (5, 1))), 1: (CUP, np.tile(AT, (5, 1)))}, rng, 30 / RATE)
    ball, other = tracker.tracks
    assert (ball.name, other.name) == ("ball", "cup")
    np.testing.assert_allclose(ball.position, cup, atol=0.01)
    np.testing.assert_allclose(other.position, AT, atol=0.01)


def test_an_object_that_starts_to_move_is_followed(rng: np.random.Generator) -> None:
    tracker = Tracker(THINGS)
    path = np.concatenate([np.tile((-0.35, -0.1, -0.05), (40, 1)), line((-0.35, -0.1, -0.05), (-0.35, 0.1, -0.05), 15)])
    run(tracker, {0: (BALL, path)}, rng)
    (track,) = tracker.tracks
    assert track.is_moving and track.seen == track.t
    np.testing.assert_allclose(track.velocity, (0.0, 0.2, 0.0), atol=0.08)
    run(tracker, {0: (BALL, np.tile(path[-1], (60, 1)))}, rng, len(path) / RATE)
    assert not tracker.tracks[0].is_moving


@given(st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_clutter_becomes_no_track(seed: int) -> None:
    """A false place in every third look, anywhere in reach."""
    rng, tracker = np.random.default_rng(seed), Tracker(THINGS, TWO)
    for step in range(200):
        somewhere = rng.uniform((-0.6, -0.4, -0.1), (-0.2, 0.4, 0.3))
        tracker.update(step / RATE, [placed(THINGS[step % 3], somewhere, 1e-6 * np.eye(3), 1e-6 * np.eye(3))] if step % 3 == 0 else [])
    assert tracker.tracks == []


def test_a_name_is_given_after_some_hits_and_forgotten_after_a_while(rng: np.random.Generator) -> None:
    tracker = Tracker([BALL], TrackSettings(hits=3, of=5, forget_after=2.0))
    pattern = (True, False, True, False, True)
    for step, shown in enumerate(pattern):
        assert tracker.tracks == []
        tracker.update(step / RATE, [look(BALL, AT, rng)] if shown else [])
    assert [track.name for track in tracker.tracks] == ["ball"]
    run(tracker, {0: (BALL, np.full((30, 3), np.nan))}, rng, 5 / RATE)
    assert [track.name for track in tracker.tracks] == ["ball"]
    run(tracker, {0: (BALL, np.full((3, 3), np.nan))}, rng, 35 / RATE)
    assert tracker.tracks == []


def test_a_surplus_object_gets_no_name(rng: np.random.Generator) -> None:
    tracker = Tracker(THINGS)
    run(tracker, {0: (BALL, np.tile(AT, (20, 1)))}, rng)
    run(tracker, {0: (BALL, np.tile(AT, (20, 1))), 1: (BALL, np.tile(AT + (0.0, 0.2, 0.0), (20, 1)))}, rng, 20 / RATE)
    (track,) = tracker.tracks
    np.testing.assert_allclose(track.position, AT, atol=0.006)


def test_a_box_keeps_its_orientation_and_size_through_equivalent_fits(rng: np.random.Generator) -> None:
    tracker = Tracker(THINGS)
    for step in range(30):
        one = placed(BOX, AT, NOISE, BIAS, yaw=0.4)
        turned = replace(one, rotation=placed(BOX, AT, NOISE, BIAS, yaw=0.4 + 0.5 * np.pi).rotation, size=one.size[[1, 0, 2]])
        tracker.update(step / RATE, [turned if step % 3 == 1 else one])
    (track,) = tracker.tracks
    np.testing.assert_allclose(track.rotation, placed(BOX, AT, NOISE, BIAS, yaw=0.4).rotation, atol=1e-9)
    np.testing.assert_allclose(track.size, BOX.size, atol=1e-9)


def test_looks_come_in_their_order() -> None:
    tracker = Tracker(THINGS)
    tracker.update(1.0, [])
    with pytest.raises(InvalidValue, match="in the order"):
        tracker.update(1.0, [])


@pytest.mark.parametrize("name", ["t", "turned", "place"])
def test_a_look_that_is_not_finite_is_refused_and_loses_no_object(name: str, rng: np.random.Generator) -> None:
    tracker = Tracker(THINGS)
    run(tracker, {0: (BALL, line(tuple(AT), tuple(AT), 6))}, rng)
    wrong = {"t": np.nan if name == "t" else 1.0, "turned": np.nan if name == "turned" else 0.0}
    with pytest.raises(InvalidValue, match="must be finite"):
        tracker.update(places=[look(BALL, AT * (np.nan if name == "place" else 1.0), rng)], **wrong)
    tracker.update(1.0, [look(BALL, AT, rng)])
    assert [track.name for track in tracker.tracks] == ["ball"]
