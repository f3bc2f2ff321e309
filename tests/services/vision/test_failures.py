# SPDX-License-Identifier: Apache-2.0
"""Cameras that fail: every object is withdrawn soon, with an event that says why, and comes back when they work again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from bus_schema.messages import Event, WorldObject
from experiments.kit.live.launch import free_port
from mobee.robot.load import load_robot
from tests.services.stage import LOOKING_DOWN, TICK, Stage, posture
from tests.services.vision.test_locator import pair_putter

Q = posture(load_robot("icub"), LOOKING_DOWN)
AT = np.array([-0.36, 0.03, -0.07])
PERIOD = 7  # ticks between two pairs of pictures
BLIND = 120  # ticks: a little more than a second
RNG = np.random.default_rng(1)


def noisy(picture: bytes) -> bytes:
    values = np.frombuffer(picture, np.uint8).astype(int)
    return np.clip(values + RNG.integers(-2, 3, values.size), 0, 255).astype(np.uint8).tobytes()


def black(picture: bytes) -> bytes:
    return bytes(len(picture))


def dim(picture: bytes) -> bytes:
    return noisy((np.frombuffer(picture, np.uint8) // 40).astype(np.uint8).tobytes())


@dataclass
class Watched:
    """A locator that sees a ball in noisy pictures, and what it publishes."""

    stage: Stage
    put: Callable[..., None]
    places: Any
    notes: Any
    seen: list[WorldObject] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def play(self, until: Callable[[], bool], **pictures: Any) -> bool:
        """Ticks with a pair of pictures at 14 Hz; none if `pictures` says so."""
        late = pictures.pop("delay", 5)

        def step() -> bool:
            k = self.stage.k
            if k % PERIOD == 0 and k > late and not pictures.get("unplugged"):
                self.put(k - late, **{"exposure": 0.01, "change": noisy, **pictures})
            for stream, kept in ((self.places, self.seen), (self.notes, self.events)):
                if (message := stream.take()) is not None:
                    kept.append(message)
            return until()

        return self.stage.play(Q, step, 20.0)

    def see(self) -> None:
        """Until the ball is published as seen now."""
        self.seen.clear()
        assert self.play(lambda: bool(self.seen) and self.seen[-1].valid_until > self.stage.k * TICK)

    def is_withdrawn(self) -> bool:
        return bool(self.seen) and self.seen[-1].valid_until == 0


@pytest.fixture(scope="module")
def watched() -> Iterator[Watched]:
    stage = Stage(free_port())
    with stage.running("services.vision", "vision"):
        yield Watched(stage, pair_putter(stage, Q, AT), stage.latest(WorldObject, "ball"), stage.latest(Event, "vision"))
    stage.close()


@pytest.mark.parametrize(
    ("failure", "says"),
    [
        ({"unplugged": True}, "no pictures come"),
        ({"change": bytes}, "left is frozen and right is frozen"),
        ({"change": black}, "left is dark and right is dark"),
        ({"change": dim}, "left is dark and right is dark"),
        ({"delay": 50}, "left is late and right is late"),
    ],
    ids=["unplugged", "frozen", "black", "lights out", "500 ms late"],
)
def test_without_pictures_that_show_what_is_there_now_the_ball_is_withdrawn(watched: Watched, failure: dict[str, Any], says: str) -> None:
    watched.see()
    watched.events.clear()
    begin = watched.stage.k
    assert watched.play(watched.is_withdrawn, **failure)
    assert BLIND - 40 < watched.stage.k - begin < BLIND + 60
    assert watched.seen[-1].t_capture <= (begin + 3 * PERIOD) * TICK
    assert watched.play(lambda: any(e.code == "stale" for e in watched.events), **failure)
    assert [e.text for e in watched.events if e.code == "stale"] == [
        f"ball is not seen any more: {says}: it is not in the model's world until it is seen again"
    ]
    assert "ball stale" in watched.stage.stat("vision").text
    watched.see()
    assert "ball 0." in watched.stage.stat("vision").text


def test_the_age_of_what_was_published_is_measured_from_the_exposure(watched: Watched) -> None:
    watched.see()
    numbers = watched.stage.stat("vision").numbers
    assert 0.0 < numbers["latency_ms_p50"] <= numbers["latency_ms_p95"] < 300.0
    assert numbers["frozen_pictures"] > 0 and numbers["late_pictures"] > 0
