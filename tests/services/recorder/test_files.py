# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import io
import random
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from mobee.errors import MobeeError
from services.recorder.files import FILES, MOST_CHANNELS, Channel, Files, parts_of
from services.recorder.reader import LARGEST_RECORD, Recording
from tests.services.recorder.recordings import Writer, message


def test_all_that_is_written_is_read_in_order_with_its_bytes(tmp_path: Path) -> None:
    writer = Writer(tmp_path, robot_sim="rate = 50")
    for k in range(30):
        writer.tick(k)
        writer.add("commands", "Commands", message(k))
    writer.files.close()
    read = list(Recording(tmp_path))
    assert [(one.key, one.type, one.payload) for one in read] == [
        (key, kind, message(k)) for k in range(30) for key, kind in (("tick", "Tick"), ("commands", "Commands"))
    ]
    assert Recording(tmp_path).settings() == {"robot_sim.toml": "rate = 50"}
    assert [one.received for one in read] == sorted(one.received for one in read)


def test_a_file_that_was_not_ended_is_read_up_to_the_last_flush(tmp_path: Path) -> None:
    writer = Writer(tmp_path)
    for k in range(5):
        for _ in range(10):
            writer.tick(k)
        writer.files.flush()
    writer.tick(99)  # not flushed: what a kill loses
    content = (tmp_path / "messages-0000.mcap").read_bytes()
    assert [one.payload for one in Recording(tmp_path)] == [message(k) for k in range(5) for _ in range(10)]

    draw = random.Random(0)
    for cut in sorted(draw.sample(range(9, len(content)), 60)):
        (tmp_path / "cut.mcap").write_bytes(content[:cut])
        read = [one.payload for one in Recording(tmp_path / "cut.mcap")]
        assert read == [message(k) for k in range(len(read) // 10) for _ in range(10)]


def test_a_damaged_file_gives_only_true_messages(tmp_path: Path) -> None:
    writer = Writer(tmp_path)
    for k in range(50):
        writer.tick(k)
        if k % 5 == 0:
            writer.files.flush()
    writer.files.close()
    content = (tmp_path / "messages-0000.mcap").read_bytes()
    true = {message(k) for k in range(50)}
    draw = random.Random(1)
    for _ in range(150):
        changed = bytearray(content)
        for _ in range(draw.choice((1, 5, 40))):
            changed[draw.randrange(8, len(changed))] = draw.randrange(256)
        (tmp_path / "changed.mcap").write_bytes(changed)
        assert {one.payload for one in Recording(tmp_path / "changed.mcap")} <= true
        Recording(tmp_path / "changed.mcap").settings()


def test_a_chunk_that_would_expand_without_bound_is_not_expanded(tmp_path: Path) -> None:
    bomb = zstandard.compress(bytes(2 * LARGEST_RECORD))
    with (tmp_path / "bomb.mcap").open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("tick", "msgpack", 0, {"encoding": "x"})
        writer.add_message(channel, 0, b"before", 0)
        writer.finish()
    content = (tmp_path / "bomb.mcap").read_bytes()
    chunk = b"\x00" * 16 + len(bomb).to_bytes(8, "little") + bytes(4) + b"\x04\x00\x00\x00zstd" + len(bomb).to_bytes(8, "little") + bomb
    end = content.index(b"\x0f\x04\x00\x00\x00\x00\x00\x00\x00")  # the record that ends the data
    record = b"\x06" + len(chunk).to_bytes(8, "little") + chunk
    (tmp_path / "bomb.mcap").write_bytes(content[:end] + record + content[end:])
    assert [one.payload for one in Recording(tmp_path / "bomb.mcap")] == [b"before"]


def test_the_oldest_files_go_when_all_are_too_large(tmp_path: Path) -> None:
    largest = 1_600_000
    files = Files(tmp_path, largest, {})
    noise = random.Random(0)
    for k in range(4000):
        files.write(Channel("tick", "msgpack", "x"), noise.randbytes(1000), k, k)
        if k % 10 == 0:
            files.flush()
    files.close()
    assert 0.5 * largest < files.size <= largest * (1 + 1 / FILES)
    kept = [one.received for one in Recording(tmp_path)]
    assert kept == list(range(kept[0], 4000))
    assert files.begun > FILES


def test_a_new_recorder_in_a_folder_continues_in_a_new_file(tmp_path: Path) -> None:
    for number in range(3):
        writer = Writer(tmp_path)
        writer.tick(number)
        if number < 2:
            writer.files.close()
    assert [path.name for path in parts_of(tmp_path)] == ["messages-0000.mcap", "messages-0001.mcap", "messages-0002.mcap"]


def test_an_empty_last_file_does_not_hide_those_before_it(tmp_path: Path) -> None:
    writer = Writer(tmp_path)
    writer.tick(1)
    writer.files.close()
    writer.tick(2)  # in the second file, not flushed: what a kill loses
    assert [path.stat().st_size > 0 for path in parts_of(tmp_path)] == [True, False]
    assert [one.payload for one in Recording(tmp_path)] == [message(1)]


def test_a_reader_of_others_finds_the_index(tmp_path: Path) -> None:
    writer = Writer(tmp_path)
    writer.tick(1)
    writer.files.close()
    reader = make_reader(io.BytesIO((tmp_path / "messages-0000.mcap").read_bytes()))
    summary = reader.get_summary()
    assert summary is not None and summary.statistics is not None and summary.statistics.message_count == 1


def test_a_folder_without_a_recording_is_refused_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(MobeeError, match="there is no messages"):
        Recording(tmp_path)
    (tmp_path / "messages-0000.mcap").write_text("no")
    with pytest.raises(MobeeError, match="no MCAP file"):
        Recording(tmp_path)
    with pytest.raises(MobeeError, match="cannot be read"):
        Recording(tmp_path / "none.mcap")


def test_keys_without_number_begin_new_files_and_lose_nothing(tmp_path: Path) -> None:
    files = Files(tmp_path, 10**9, {})
    names = [f"event/x{n}" for n in range(2 * MOST_CHANNELS + 10)]
    for n, name in enumerate(names):
        files.write(Channel(name, "json", "json"), b"{}", n, n)
    files.close()
    assert [one.key for one in Recording(tmp_path)] == names
    assert files.begun == 3


@contextmanager
def full_disk(room: int) -> Iterator[None]:
    """In it this process can write files of at most `room` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_after_a_full_disk_a_new_file_begins_and_all_that_was_flushed_is_read(tmp_path: Path) -> None:
    files, noise = Files(tmp_path, 2 * 10**9, {}), random.Random(0)

    def write(batch: int) -> None:
        for _ in range(50):
            files.write(Channel("tick", "msgpack", "x"), noise.randbytes(2000), batch, batch)
        files.flush()

    write(0)
    with full_disk(files.size + 50_000), pytest.raises(OSError, match="File too large"):
        write(1)
    for batch in (2, 3):
        write(batch)
    files.close()
    assert [one.received for one in Recording(tmp_path)] == [batch for batch in (0, 2, 3) for _ in range(50)]
    assert files.begun == len(parts_of(tmp_path)) == 2


def test_tries_on_a_full_disk_leave_no_files_that_cannot_be_read(tmp_path: Path) -> None:
    writer = Writer(tmp_path, robot_sim="rate = 50")
    with full_disk(0):
        for end in (writer.files.flush, writer.files.close):
            writer.tick(0)
            with pytest.raises(OSError, match="File too large"):
                end()
            assert parts_of(tmp_path) == [] and writer.files.begun == 0
    writer.tick(1)
    writer.files.close()
    assert [one.payload for one in Recording(tmp_path)] == [message(1)] and writer.files.begun == 1
