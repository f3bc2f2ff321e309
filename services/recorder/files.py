# SPDX-License-Identifier: Apache-2.0
"""The MCAP files of a recording. One file is written at a time; the oldest ones are removed when all together are too large."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from mcap.writer import CompressionType, Writer

FILES = 128  # of which a full recording consists; the index of the one that is written is in memory, 60 kB a megabyte
_NAME = re.compile(r"messages-(\d{4,})\.mcap$")
MOST_CHANNELS = 5000  # of a file: the format numbers 65 535, and every chunk has an index of each
_CHUNK = 4_000_000  # bytes; a chunk ends earlier, at every flush


@dataclass(frozen=True, slots=True)
class Channel:
    """The messages of one key in one encoding. Channels with equal fields are the same channel.

    `topic`: the key. `encoding`: short name of the encoding: msgpack, json or cdr. `about`: for messages that are recorded unchanged, the
    full encoding string that was sent with them on the bus (`bus_schema.encoding_of`); empty for copies of messages in another format.
    `schema`: name of the schema; empty: none. `schema_encoding`, `definition`: format and content of the schema.
    """

    topic: str
    encoding: str
    about: str = ""
    schema: str = ""
    schema_encoding: str = ""
    definition: bytes = b""


def parts_of(folder: Path) -> list[Path]:
    """Return the files messages-*.mcap of the recording in a folder, the oldest first."""
    return [path for _, path in sorted(_numbered(folder).items())]


def _numbered(folder: Path) -> dict[int, Path]:
    return {int(match[1]): path for path in folder.iterdir() if (match := _NAME.match(path.name))}


class Files:
    """Writes messages to the files of a recording. Its methods raise OSError if a file cannot be written.

    The next message then begins a new file: what follows an incomplete record in a file cannot be read.
    """

    def __init__(self, folder: Path, largest: int, settings: Mapping[str, bytes]) -> None:
        """Prepare the recording in a folder.

        `largest`: largest size of all files together [bytes]. `settings`: content of the settings files, by name, which is attached to each
        file.
        """
        self._folder, self._largest, self._settings = folder, largest, settings
        self._file: IO[bytes] | None = None
        self._is_flushed = False  # at least once, the present file
        self._writer: Writer
        self._channels: dict[Channel, int] = {}
        self.begun = 0  # files

    @property
    def size(self) -> int:
        """The present size of all files of the recording [bytes]."""
        return sum(path.stat().st_size for path in parts_of(self._folder))

    def write(self, channel: Channel, data: bytes, received: int, published: int, sequence: int = 0) -> None:
        """Add a message to a channel.

        `data`: content of the message. `received`, `published`: times of receipt and of publication, ns since 1970. `sequence`: number that
        the sender gave to the message.
        """
        try:
            if self._file is None:
                self._begin()
            number = self._channels.get(channel)
            if number is None and len(self._channels) >= MOST_CHANNELS:
                self._end_part()
                self._begin()
            if number is None:
                number = self._channels[channel] = self._register(channel)
            self._writer.add_message(number, received, data, published, sequence)
        except OSError:
            self._give_up()
            raise

    def flush(self) -> None:
        """Hand all data to the operating system, so that they are kept even if this process is killed.

        If the present file is then larger than `largest` / 128 (FILES), it is closed, and the next message begins a new file. `largest` is
        the size limit of all files together.
        """
        if self._file is None:
            return
        try:
            self._writer.flush()  # type: ignore[no-untyped-call]  # the package lacks the annotation
        except OSError:
            self._give_up()
            raise
        self._is_flushed = True
        if self._file.tell() > self._largest / FILES:
            self._end_part()

    def _end_part(self) -> None:
        self.close()
        self._remove_oldest()

    def close(self) -> None:
        """Write the index of the present file, and close the file; nothing is done if no file is open."""
        if self._file is None:
            return
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]  # as above
            self._file.close()
        except OSError:
            self._give_up()
            raise
        self._file = None

    def _give_up(self) -> None:
        """Close the present file without an index, after a failed write; remove it if nothing in it can be read."""
        if self._file is None:
            return
        file, self._file = self._file, None
        with suppress(OSError):  # of the write that is tried again: the file is closed nevertheless
            file.close()
        if not self._is_flushed:
            Path(file.name).unlink()
            self.begun -= 1

    def _begin(self) -> None:
        number = 1 + max(_numbered(self._folder), default=-1)
        self._file = (self._folder / f"messages-{number:04}.mcap").open("xb")
        self._is_flushed = False
        self.begun += 1
        self._channels.clear()
        self._writer = Writer(self._file, chunk_size=_CHUNK, compression=CompressionType.ZSTD)
        self._writer.start(library="mobee")
        now = time.time_ns()
        for name, text in self._settings.items():
            self._writer.add_attachment(now, now, name, "application/toml", text)

    def _register(self, channel: Channel) -> int:
        schema = self._writer.register_schema(channel.schema, channel.schema_encoding, channel.definition) if channel.schema else 0
        return self._writer.register_channel(channel.topic, channel.encoding, schema, {"encoding": channel.about} if channel.about else {})

    def _remove_oldest(self) -> None:
        parts, share = parts_of(self._folder), self._largest / FILES
        while len(parts) > 1 and sum(path.stat().st_size for path in parts) > self._largest - share:
            parts.pop(0).unlink()
