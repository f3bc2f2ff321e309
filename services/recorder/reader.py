# SPDX-License-Identifier: Apache-2.0
"""Reads recordings. Of a file whose recorder was killed, everything up to the last complete chunk is read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from struct import error as StructError
from typing import IO, cast

import zstandard
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from mobee.errors import MobeeError
from services.common.tap import Raw
from services.recorder.files import parts_of

LARGEST_RECORD = 64_000_000  # bytes: many times a chunk of a recorder
_DAMAGE = (McapError, StructError, zstandard.ZstdError, ValueError, EOFError)  # of a file that ends in the middle, or was changed


class Recording:
    """A recording: one MCAP file, or all messages-*.mcap files in the folder of a run.

    Iteration yields the messages in the order of arrival, without the copies (JSON, ROS 2) that the recorder adds for viewers.
    """

    def __init__(self, place: Path) -> None:
        """Find the files; `place`: a file or a folder. Raises MobeeError if there are none, or one of them is not an MCAP file."""
        try:
            # A file is empty for half a second after its begin, and remains so if the recorder is killed then.
            self.files = [path for path in parts_of(place) if path.stat().st_size] if place.is_dir() else [place]
            for path in self.files:
                with path.open("rb") as file:
                    if file.read(8) != b"\x89MCAP0\r\n":
                        raise MobeeError(f"{path}: no MCAP file; `mobee record` and `mobee launch` write messages-0000.mcap")
        except OSError as error:
            raise MobeeError(f"{error.filename}: cannot be read ({error.strerror})") from None
        if not self.files:
            raise MobeeError(
                f"{place}: there is no messages-*.mcap with content; `mobee launch` records unless it is started with --no-record"
            )

    def settings(self) -> dict[str, str]:
        """Return the settings files of the run that are attached to the recording: text by file name."""
        found = {}
        with self.files[0].open("rb") as file:
            for record in _records(file):
                if isinstance(record, Chunk):
                    break  # they are at the begin
                if isinstance(record, Attachment):
                    found[record.name] = record.data.decode(errors="replace")
        return found

    def __iter__(self) -> Iterator[Raw]:
        """Yield all messages, and liveliness tokens (signs that services run; key `alive`), in the order of arrival.

        The copies in JSON and ROS 2 formats, which the recorder adds for viewers such as Foxglove, are left out.
        """
        for path in self.files:
            channels: dict[int, Channel] = {}
            with path.open("rb") as file:
                for record in _records(file):
                    if isinstance(record, Chunk):
                        yield from _in_chunk(record, channels)


class _Bounded:
    """A file that refuses reads larger than the largest record, since a damaged length must not make the reader use up the memory."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        """Read `size` bytes; raises ValueError for a size that only a damaged file can have."""
        if size > LARGEST_RECORD:
            raise ValueError(f"a field of {size} bytes")
        return self._file.read(size)


def _records(file: IO[bytes]) -> Iterator[McapRecord]:
    """Yield the records before the end, or before the first that is damaged or incomplete."""
    try:
        yield from StreamReader(cast(IO[bytes], _Bounded(file)), emit_chunks=True, record_size_limit=LARGEST_RECORD).records
    except _DAMAGE:
        return


def _in_chunk(chunk: Chunk, channels: dict[int, Channel]) -> Iterator[Raw]:
    try:
        records = breakup_chunk(chunk, validate_crc=True) if _size(chunk) <= LARGEST_RECORD else []
    except _DAMAGE:
        return
    for record in records:
        if isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel = channels.get(record.channel_id)
            if channel is not None and "encoding" in channel.metadata:
                yield Raw(channel.topic, channel.metadata["encoding"], record.data, record.log_time, record.publish_time)


def _size(chunk: Chunk) -> int:
    """Return the size to which a chunk expands; raises ZstdError if its frame is damaged."""
    expanded = int(zstandard.frame_content_size(chunk.data)) if chunk.compression == "zstd" else len(chunk.data)
    return max(expanded, chunk.uncompressed_size)
