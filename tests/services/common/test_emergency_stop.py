# SPDX-License-Identifier: Apache-2.0
"""The record of emergency stops on disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.common.emergency_stop import Stop, StopRecord

STOP = Stop("mobee", "a hand in the way", 1.8e9)


def test_a_record_holds_the_stop_until_its_release_and_the_newest_creation_changes_nothing(tmp_path: Path) -> None:
    record = StopRecord(tmp_path / "states" / "stop.json")
    record.create()
    assert record.read() is None
    record.latch(STOP)
    record.create()
    record.remove()
    assert StopRecord(record.path).read() == STOP
    before = record.released_at()
    record.release()
    assert record.read() is None and record.released_at() > before
    record.remove()
    assert list(record.path.parent.iterdir()) == []


DAMAGED = [b"", b"{", b"null", b"[]", b'{"stopped": true}', b'{"stopped": 0}', b'{"stopped": "false"}', b"\xff\x00", b"[" * 100_000]


@pytest.mark.parametrize("content", [None, *DAMAGED])
def test_a_record_that_is_absent_or_damaged_counts_as_a_stop(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "stop.json"
    if content is not None:
        path.write_bytes(content)
    stop = StopRecord(path).read()
    assert stop is not None and str(path) in stop.reason
    assert StopRecord(path).released_at() == 0


def test_each_endpoint_has_a_record_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    paths = {StopRecord.of_endpoint(endpoint).path for endpoint in ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7448", "tcp/[::1]:7447")}
    assert len(paths) == 3 and all(path.is_relative_to(tmp_path) for path in paths)
