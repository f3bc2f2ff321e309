# SPDX-License-Identifier: Apache-2.0
"""The frames that a viewer in a browser gets, and those that a slow viewer skips."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Iterator

import pytest

rr = pytest.importorskip("rerun")
import rerun.blueprint as rrb  # noqa: E402  # only where Rerun is

from services.monitor.viewer import frames as frames_module  # noqa: E402  # only where Rerun is
from services.monitor.viewer.frames import Frames  # noqa: E402  # only where Rerun is


@pytest.fixture
def frames() -> Iterator[Frames]:
    made = Frames(None, rrb.Blueprint(), "test")
    yield made
    made.close()


def pieces(answer: bytes) -> tuple[int, float, list[bytes]]:
    number, when = struct.unpack_from("<Qd", answer)
    at, found = 16, []
    while at < len(answer):
        (length,) = struct.unpack_from("<I", answer, at)
        found.append(answer[at + 4 : at + 4 + length])
        at += 4 + length
    return number, when, found


def update(frames: Frames, when: float) -> None:
    frames.set_time("t", when)
    frames.begin_update()
    frames.log("pose", rr.Scalars(when))
    frames.end_update()


def asked(frames: Frames, after: int, when: float) -> tuple[int, float, list[bytes]]:
    """The answer to a viewer that asks before the update of a time."""
    answers: list[bytes] = []
    viewer = threading.Thread(target=lambda: answers.append(frames.newest(after, 20.0)))
    viewer.start()
    give_up = time.monotonic() + 20.0
    while not answers and time.monotonic() < give_up:
        update(frames, when)
        time.sleep(0.01)
    viewer.join(20.0)
    return pieces(answers[0])


def test_a_new_viewer_gets_static_data_once_and_then_updates(frames: Frames) -> None:
    frames.log("shape", rr.Boxes3D(sizes=[[1.0, 1.0, 1.0]]), static=True)
    number, when, first = asked(frames, 0, 1.0)
    assert (number, when, len(first)) == (1, 1.0, 2)
    assert all(piece.startswith(b"RRF2") for piece in first)
    number, when, second = asked(frames, number, 2.0)
    assert (number, when, len(second)) == (2, 2.0, 1)


def test_a_slow_viewer_gets_the_newest_update_and_every_change(frames: Frames) -> None:
    number, _, _ = asked(frames, 0, 1.0)
    for step in range(50):
        update(frames, 2.0 + step)  # no viewer waits for these
    frames.log("event", rr.TextLog("something"))
    number, when, found = asked(frames, number, 60.0)
    assert (number, when) == (2, 60.0)
    assert len(found) == 2  # the event, the update


def test_without_a_viewer_nothing_is_kept(frames: Frames, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames_module, "WANTED_FOR", 0.0)
    for step in range(20):
        frames.log("event", rr.TextLog("something"))
        update(frames, float(step))
    assert len(asked(frames, 0, 30.0)[2]) == 2  # the layout, the update


def test_the_file_gets_every_fourth_update_and_a_viewer_the_one_that_it_waits_for() -> None:
    made = Frames(rr.RecordingStream("test"), rrb.Blueprint(), "test")
    needed = []
    for _ in range(8):
        needed.append(made.begin_update())
        made.end_update()
    assert needed == [True, False, False, False] * 2
    viewer = threading.Thread(target=made.newest, args=(0, 20.0))
    viewer.start()
    give_up = time.monotonic() + 20.0
    while viewer.is_alive() and time.monotonic() < give_up:
        update(made, 1.0)
    assert not viewer.is_alive()
    made.close()


def test_a_viewer_waits_for_an_update_but_not_for_ever(frames: Frames) -> None:
    assert pieces(frames.newest(0, 0.05)) == (0, 0.0, [])
