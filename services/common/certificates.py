# SPDX-License-Identifier: Apache-2.0
"""A folder of keys: a small certificate authority, and an identity (private key and certificate) for each service and kind of client.

The certificate of an identity holds its name (CN) and its party (OU), the role that decides what it may do (bus_schema/authority.py).
"""

from __future__ import annotations

import datetime
import os
import re
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from bus_schema.stream import Party
from services.common.identity import AUTHORITY, ROUTER, BadKeys, Identity, require_private

DAYS, AUTHORITY_DAYS = 365, 3650  # validity
SOON = 30  # days before the end of validity from which it is reported
_EARLIER = datetime.timedelta(days=1)  # from when on a certificate is valid: clocks of hosts differ
_ORGANISATION = "MoBeE"
_NAME = re.compile(r"[a-z0-9_]{1,64}")


@dataclass(frozen=True, slots=True)
class Issued:
    """The content of an identity's certificate: its name, its party (role on the bus; None: the router), and the time of its expiry."""

    name: str
    party: Party | None
    until: datetime.datetime

    def days_left(self, now: datetime.datetime | None = None) -> int:
        """Return the number of whole days until the certificate expires; negative if it has expired. `now`: None: the present time."""
        return (self.until - (now or _now())).days


class KeyFolder:
    """A folder with the certificate of a certificate authority, and with a private key and a certificate for each identity.

    An identity is a service, the router, or a kind of client. The private key of the authority may be in another place.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def new(cls, path: Path, identities: Iterable[tuple[str, Party | None]], days: int = DAYS) -> KeyFolder:
        """Make a certificate authority, and a key and a certificate for each identity, in a new or empty folder; return the folder.

        `identities`: pairs of name and party (role on the bus; None: the router). `days`: number of days for which the certificates of the
        identities are valid. Raises BadKeys if the folder contains files, or if a name is not valid; OSError if it cannot be written.
        """
        wanted = list(identities)
        require_names(name for name, _ in wanted)
        if path.exists() and any(path.iterdir()):
            raise BadKeys(
                f"{path} holds files already, and keys in use must not be replaced: name another folder, or add to it with `keys add`"
            )
        path.mkdir(parents=True, exist_ok=True)
        path.chmod(0o700)
        key = ec.generate_private_key(ec.SECP256R1())
        name = _subject(f"authority {secrets.token_hex(4)}", AUTHORITY)  # two authorities of one name would be mistaken for each other
        usage = x509.KeyUsage(
            False, False, False, False, False, key_cert_sign=True, crl_sign=True, encipher_only=False, decipher_only=False
        )
        own = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
        built = _builder(name, name, key.public_key(), AUTHORITY_DAYS).add_extension(x509.BasicConstraints(ca=True, path_length=0), True)
        certificate = built.add_extension(usage, True).add_extension(own, False).sign(key, hashes.SHA256())
        _write(path / f"{AUTHORITY}.key", _pem(key))
        _write(path / f"{AUTHORITY}.crt", certificate.public_bytes(Encoding.PEM))
        folder = cls(path)
        folder.add(wanted, days)
        return folder

    def add(self, identities: Iterable[tuple[str, Party | None]], days: int = DAYS) -> None:
        """Make a key and a certificate for each identity, or replace old ones.

        `identities`: pairs of name and party (role on the bus; None: the router). `days`: number of days for which the certificates are
        valid. Raises BadKeys if a name is not valid, or if the key of the authority is missing; OSError if a file cannot be written.
        """
        wanted = list(identities)
        require_names(name for name, _ in wanted)
        authority, key = self._authority(), self._authority_key()
        for name, party in wanted:
            own = ec.generate_private_key(ec.SECP256R1())
            use = ExtendedKeyUsageOID.SERVER_AUTH if name == ROUTER else ExtendedKeyUsageOID.CLIENT_AUTH
            built = (
                _builder(_subject(name, party or ROUTER), authority.subject, own.public_key(), days)
                .add_extension(x509.BasicConstraints(ca=False, path_length=None), True)
                .add_extension(x509.ExtendedKeyUsage([use]), False)
                .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key()), False)
            )
            identity = Identity(self.path, name)
            _write(identity.key, _pem(own))
            _write(identity.certificate, built.sign(key, hashes.SHA256()).public_bytes(Encoding.PEM))

    def issued(self) -> list[Issued]:
        """Return name, party and time of expiry of the certificate of every identity, sorted by name.

        Raises BadKeys for a certificate that cannot be read, is of another authority, or has another name than its file, and for a folder
        that is missing or can be read by other users.
        """
        require_private(self.path)
        authority = self._authority()
        paths = (path for path in sorted(self.path.glob("*.crt")) if path.stem != AUTHORITY)
        return [_checked(path, authority) for path in paths]

    def require(self, names: Iterable[str]) -> None:
        """Raise BadKeys for the first of the identities `names` that cannot be used.

        This is so if its key or its certificate is missing, if the key can be read by other users, or if the certificate is expired.
        """
        known = {one.name: one for one in self.issued()}
        for name in names:
            Identity(self.path, name).require()
            self._require_valid(known[name])

    def require_certificates(self, names: Iterable[str]) -> None:
        """Raise BadKeys for the first of the identities `names` whose certificate is missing or expired.

        Their private keys are not tested, because they may be on another host.
        """
        known = {one.name: one for one in self.issued()}
        for name in names:
            if name not in known:
                raise BadKeys(
                    f"{self.path / name}.crt is missing, so that {name} of another host cannot connect: make it with `mobee keys add "
                    f"{name} --keys {self.path}`"
                )
            self._require_valid(known[name])

    def _require_valid(self, one: Issued) -> None:
        if one.days_left() < 0:
            raise BadKeys(
                f"the certificate of {one.name} in {self.path} expired on {one.until:%Y-%m-%d}: "
                f"renew it with `mobee keys add {one.name} --keys {self.path}`"
            )

    def _authority(self) -> x509.Certificate:
        path = self.path / f"{AUTHORITY}.crt"
        if not path.is_file():
            raise BadKeys(f"{path} is missing: {self.path} is no folder of keys. `mobee keys new` makes one, --keys names another")
        return _read(path)

    def _authority_key(self) -> ec.EllipticCurvePrivateKey:
        path = self.path / f"{AUTHORITY}.key"
        require_private(path)
        key = load_pem_private_key(path.read_bytes(), None)
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise BadKeys(f"{path} is not a key that `mobee keys new` has made")
        return key


def require_names(names: Iterable[str]) -> None:
    """Raise BadKeys for the first of the names that cannot be that of an identity."""
    for name in names:
        if not _NAME.fullmatch(name) or name == AUTHORITY:
            raise BadKeys(f"{name!r} cannot name an identity: use 1 to 64 of a-z, 0-9 and _ only, and not {AUTHORITY!r}")


def _checked(path: Path, authority: x509.Certificate) -> Issued:
    certificate = _read(path)
    try:
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature):
        raise BadKeys(
            f"{path} is not of the authority in {path.parent / f'{AUTHORITY}.crt'}: use a folder whose files were made together"
        ) from None
    name, unit = _one(certificate, NameOID.COMMON_NAME), _one(certificate, NameOID.ORGANIZATIONAL_UNIT_NAME)
    party = next((party for party in get_args(Party) if party == unit), None)
    if name != path.stem or (party is None) != (name == ROUTER):
        raise BadKeys(f"{path} is the certificate of {name!r} ({unit}): the file of an identity has its name")
    return Issued(name, party, certificate.not_valid_after_utc)


def _read(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except (OSError, ValueError) as error:
        raise BadKeys(f"{path} cannot be read as a certificate: {error}") from None


def _one(certificate: x509.Certificate, oid: x509.ObjectIdentifier) -> str:
    return next((str(found.value) for found in certificate.subject.get_attributes_for_oid(oid)), "")


def _subject(name: str, party: str) -> x509.Name:
    parts = ((NameOID.ORGANIZATION_NAME, _ORGANISATION), (NameOID.ORGANIZATIONAL_UNIT_NAME, party), (NameOID.COMMON_NAME, name))
    return x509.Name([x509.NameAttribute(oid, text) for oid, text in parts])


def _builder(subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, days: int) -> x509.CertificateBuilder:
    begin = _now() - _EARLIER
    named = x509.CertificateBuilder().subject_name(subject).issuer_name(issuer).public_key(key)
    return named.serial_number(x509.random_serial_number()).not_valid_before(begin).not_valid_after(_now() + datetime.timedelta(days=days))


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


def _pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def _write(path: Path, content: bytes) -> None:
    """Write a file that only its owner may read; an old one is replaced as a whole."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(content)
    draft.replace(path)
