# SPDX-License-Identifier: Apache-2.0
"""The address of the bus, and the identity of a process on a secured one: a key and a certificate that environment variables name."""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path

from mobee.errors import MobeeError

KEYS, IDENTITY = "MOBEE_KEYS", "MOBEE_IDENTITY"
"""Environment variables. MOBEE_KEYS: the folder of keys; if it is not set, the connection is not secured. MOBEE_IDENTITY: the name of the
identity of this process in that folder."""

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"  # of the router
OPERATOR = "operator"  # the identity of the commands at a terminal, unless another is named
ROUTER = "router"  # the only identity that a process may listen with
AUTHORITY = "ca"
LONGEST_SOCKET = 90  # bytes; a socket's name holds 104 on macOS, 108 on Linux, and its lock file is a little longer
_SECURED, _PLAIN = "tls/", "tcp/"


class BadKeys(MobeeError):
    """Raised for keys that are missing, unsafe, expired or of another authority; the message contains the remedy."""


@dataclass(frozen=True, slots=True)
class Identity:
    """An identity in a secured system: the name of a private key and a certificate in a folder of keys."""

    folder: Path
    name: str

    @classmethod
    def of_environment(cls) -> Identity | None:
        """Return the identity that the environment names; None if MOBEE_KEYS is not set. Without MOBEE_IDENTITY its name is `operator`."""
        folder = os.environ.get(KEYS)
        return cls(Path(folder), os.environ.get(IDENTITY, OPERATOR)) if folder else None

    def environment(self) -> dict[str, str]:
        """Return the environment variables that give a process this identity."""
        return {KEYS: str(self.folder), IDENTITY: self.name}

    @property
    def certificate(self) -> Path:
        """Path of the certificate of this identity."""
        return self.folder / f"{self.name}.crt"

    @property
    def key(self) -> Path:
        """Path of the private key of this identity."""
        return self.folder / f"{self.name}.key"

    @property
    def authority(self) -> Path:
        """Path of the certificate of the authority, with which the certificates of others are checked."""
        return self.folder / f"{AUTHORITY}.crt"

    def socket(self, endpoint: str) -> str:
        """Return the second address at which the secured router of `endpoint` listens: a Unix socket in the folder of keys.

        The commands that a user starts on the router's host (identity `operator`) connect there. Only users who may read the keys can
        connect, and their connections are handled before those of others. The result is empty if the system has no Unix sockets, or if the
        path of the socket is too long.
        """
        path = self.folder / f"{endpoint.rpartition(':')[2]}.sock"
        return f"unixsock-stream/{path}" if os.name == "posix" and len(os.fsencode(path)) <= LONGEST_SOCKET else ""

    def endpoints(self, endpoint: str) -> list[str]:
        """Return the addresses at which this identity can connect to the secured router that listens at `endpoint`.

        They are in the order of preference: first the router's Unix socket if there is one and this process is a local `operator`, then
        `endpoint` with TLS.
        """
        socket = self.socket(endpoint) if self.name == OPERATOR and is_local(endpoint) else ""
        here = socket and Path(socket.partition("/")[2]).exists()
        return [socket, secured(endpoint)] if here else [secured(endpoint)]

    def require(self) -> None:
        """Raise BadKeys if a file of this identity is missing, or if other users may read its private key or the folder of these files."""
        require_private(self.folder)
        for path in (self.authority, self.certificate, self.key):
            if not path.is_file():
                raise BadKeys(
                    f"{path} is missing, so that nothing can connect as {self.name}: make it with `mobee keys add {self.name} "
                    f"--keys {self.folder}` where {AUTHORITY}.key is, or name another folder with --keys or {KEYS}"
                )
        require_private(self.key)

    def settings(self) -> dict[str, object]:
        """Return the settings of Zenoh with which this process shows its certificate, and accepts only certificates of the same authority.

        A client does not compare the name in the router's certificate with the name of the host. This is not necessary, because no other
        certificate of the authority is valid for a server.
        """
        listens = self.name == ROUTER
        own = {"listen_certificate": str(self.certificate), "listen_private_key": str(self.key)}
        if not listens:
            own = {"connect_certificate": str(self.certificate), "connect_private_key": str(self.key)}
        common = {"root_ca_certificate": str(self.authority), "enable_mtls": True, "verify_name_on_connect": False}
        return {"transport/link/tls": {**common, **own}}


def assume(identity: Identity | None) -> None:
    """Give this process the identity `identity`, by its environment variables; None: no identity.

    A launcher calls this, because it has inherited the identity of its user in these variables, and its services must not inherit it.
    """
    for name in (KEYS, IDENTITY):
        os.environ.pop(name, None)
    if identity is not None:
        os.environ.update(identity.environment())


def require_private(path: Path) -> None:
    """Raise BadKeys if a file or folder does not exist, belongs to another user, or can be read by other users."""
    try:
        found = path.stat()
    except OSError as error:
        raise BadKeys(f"{path}: {error.strerror}; `mobee keys new` makes a folder of keys, --keys or {KEYS} names one") from None
    if os.name != "posix":
        return
    if found.st_uid not in (os.geteuid(), 0):
        raise BadKeys(f"{path} belongs to another user (number {found.st_uid}): use keys of your own")
    if stat.S_IMODE(found.st_mode) & 0o077:
        mode = "700" if path.is_dir() else "600"
        raise BadKeys(f"{path} can be read by other users (mode {stat.S_IMODE(found.st_mode):03o}): run `chmod {mode} {path}`")


def default_folder() -> Path:
    """Return the folder of keys of this user: MOBEE_KEYS if it is set, otherwise mobee/keys in the user's folder of settings."""
    given = os.environ.get(KEYS)
    return Path(given) if given else Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "mobee" / "keys"


def secured(endpoint: str) -> str:
    """Return the address at which a secured router listens: `endpoint` with TLS in place of plain TCP. Other addresses are not changed."""
    return _SECURED + endpoint.removeprefix(_PLAIN) if endpoint.startswith(_PLAIN) else endpoint


def is_local(endpoint: str) -> bool:
    """Return whether only processes of this host can connect to the address `endpoint`."""
    protocol, _, place = endpoint.partition("/")
    host = place.rpartition(":")[0].strip("[]")
    return protocol.startswith("unix") or host in ("localhost", "::1") or host.startswith("127.")
