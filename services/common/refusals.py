# SPDX-License-Identifier: Apache-2.0
"""What a secured router refuses: connections without a valid certificate, and messages that the access list does not allow.

Zenoh reports these refusals only in its log, which it prints on the standard output of the process.  `RefusalLog.open` redirects this log
to a pipe, which a thread reads several times a second.  What the program itself prints still goes to the original standard output.
"""

from __future__ import annotations

import os
import re
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import zenoh

from services.common.identity import OPERATOR

LEVELS = "zenoh::net::routing::interceptor::access_control=trace,zenoh_link_tls=warn"
_LOG_LEVELS, _NO_COLOUR = "RUST_LOG", "NO_COLOR"  # environment variables that Zenoh reads
_PIPE_SIZE = 1 << 20  # bytes: the log of half a second; if nobody reads it, Zenoh drops lines instead of waiting
_CHUNK = 1 << 16  # bytes
_MANY_CHUNKS = _PIPE_SIZE // _CHUNK // 8  # in one reading
_PERIOD, _SHORT_PERIOD = 0.1, 0.002  # s between two readings
_MOST_CHUNKS = 2 * _PIPE_SIZE // _CHUNK  # in one reading
_MOST_NAMES = 1000

_DENIED = re.compile(
    r"(?P<session>[0-9a-f]+)(?: on \S*?(?:CertCommonName\((?P<name>[^)]*)\)|(?P<socket>UnixsockStream))\S*)? is unauthorized to "
    r"(?P<action>[^(]+) \(ingress\) on (?P<key>\S+)"
)
_CACHED = "Using cached result"
_PREPARES = re.compile(r"(?P<thread>ThreadId\(\d+\)).*ACL \((?:in|e)gress\): caching permissions for `(?P<key>[^`]*)`")
_THREAD = re.compile(r"ThreadId\(\d+\)")
_STRANGER = re.compile(r"(?P<session>[0-9a-f]+) did not match any configured ACL subject")
_MATTERS = (b"is unauth", b"WARN", b"did not match", b"caching")  # in each line that is read; there are thousands of others a second
_LINK = re.compile(r"zenoh_link_tls\S* (?P<why>.*?)\.? Hint:")
_GAVE_UP = "tls handshake eof"  # the other side has ended the connection, for example because the machine is busy

_SAID = {
    "Put": "publish on",
    "Delete": "delete",
    "Query": "call",
    "Reply": "answer",
    "Declare Subscriber": "read",
    "Declare Queryable": "answer",
    "Liveliness Token": "declare the token",
    "Liveliness Query": "read the tokens",
    "Declare Liveliness Subscriber": "read the tokens",
}


@dataclass(frozen=True, slots=True)
class Refusal:
    """A description of a message or connection that the secured router refused.

    Two refusals with the same text are equal, so that they can be counted.
    """

    text: str

    @classmethod
    def of_message(cls, name: str, action: str, key: str) -> Refusal:
        """Return the refusal of a message.

        `name`: identity of the sender. `action`: what it tried, in Zenoh's words, such as "Put". `key`: the key of the message.
        """
        return cls(f"{name} may not {_SAID.get(action, action.lower())} {key}")


@dataclass
class RefusalLog:
    """Reads the log of Zenoh and counts the messages and connections that the secured router in this process refuses.

    `open` makes the object, and `take` returns the counts.
    """

    _reader: int
    _rest: bytes = b""
    _names: dict[str, str] = field(default_factory=dict)  # of identities, by the id of their session
    _found: Counter[Refusal] = field(default_factory=Counter)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _prepared: dict[str, tuple[str, set[str]]] = field(default_factory=dict)  # by thread: a key, and for what it is prepared

    @classmethod
    def open(cls) -> RefusalLog:
        """Redirect the log of Zenoh to a pipe and return the object that reads it; call this once, before the process's first session."""
        import fcntl  # not on Windows

        reader, writer = os.pipe()
        for end in (reader, writer):
            os.set_blocking(end, False)
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, _PIPE_SIZE)
        sys.stdout.flush()
        sys.stdout = os.fdopen(os.dup(1), "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors)
        os.dup2(writer, 1, inheritable=False)
        os.close(writer)
        before = {name: os.environ.get(name) for name in (_LOG_LEVELS, _NO_COLOUR)}
        os.environ.update({_LOG_LEVELS: LEVELS, _NO_COLOUR: "1"})
        zenoh.init_log_from_env_or(LEVELS)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        log = cls(reader)
        threading.Thread(target=log._watch, name="refusals", daemon=True).start()
        return log

    def take(self) -> Counter[Refusal]:
        """Return the refusals since the last call, each with its number of occurrences."""
        with self._lock:
            found, self._found = self._found, Counter()
        return found

    def read(self) -> bool:
        """Read what Zenoh has logged since the last call. Return True if it was so much that the next call should come soon."""
        for chunks in range(_MOST_CHUNKS):
            try:
                chunk = os.read(self._reader, _CHUNK)
            except BlockingIOError:
                return chunks > _MANY_CHUNKS
            for line in self._lines(chunk):
                if refusal := self._refusal(line):
                    with self._lock:
                        self._found[refusal] += 1
        return True

    def _watch(self) -> None:
        """Empty the pipe also while the main thread waits: for each line that does not fit Zenoh writes an error to standard error."""
        while True:
            time.sleep(_SHORT_PERIOD if self.read() else _PERIOD)

    def _lines(self, chunk: bytes) -> Iterator[str]:
        """Yield the lines that matter and end in the next chunk of the log."""
        whole, _, self._rest = (self._rest + chunk).rpartition(b"\n")
        if any(word in whole for word in _MATTERS):
            yield from (line.decode(errors="replace") for line in whole.split(b"\n") if any(word in line for word in _MATTERS))

    def _refusal(self, line: str) -> Refusal | None:
        if denied := _DENIED.search(line):
            session, action, key = denied["session"], denied["action"].strip(), denied["key"]
            if name := denied["name"] or (denied["socket"] and OPERATOR):
                self._names[session] = name
                if len(self._names) > _MOST_NAMES:
                    del self._names[next(iter(self._names))]
            if action.startswith("Undeclare") or self._is_preparation(line, action, key):
                return None
            return Refusal.of_message(self._names.get(session, f"session {session}"), action, key)
        if prepares := _PREPARES.search(line):
            self._prepared[prepares["thread"]] = (prepares["key"], set())
        elif stranger := _STRANGER.search(line):
            return Refusal(f"session {stranger['session']} has a certificate of no identity that this system knows: it may do nothing")
        elif (link := _LINK.search(line)) and link["why"] != _GAVE_UP:
            return Refusal(f"a connection was refused: {link['why']}")
        return None

    def _is_preparation(self, line: str, action: str, key: str) -> bool:
        """Return whether a "denied" line of Zenoh's log is no refusal, since Zenoh only computes the permissions for a key in advance.

        A thread of Zenoh first logs the key of this computation, then each kind of denied message once. `action`: the kind of message in
        this line. A line of another key, or of an action that was already logged, ends the preparation of this thread.
        """
        if _CACHED in line or not (thread := _THREAD.search(line)):
            return False
        prepared, seen = self._prepared.get(thread[0], ("", set()))
        if prepared != key or action in seen:
            self._prepared.pop(thread[0], None)
            return False
        seen.add(action)
        return True
