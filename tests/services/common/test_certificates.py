# SPDX-License-Identifier: Apache-2.0
"""A folder of keys: what it makes, what it refuses, and what each error names."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from services.common.certificates import KeyFolder
from services.common.identity import BadKeys, Identity, assume, is_local, secured


@pytest.fixture
def keys(tmp_path: Path) -> KeyFolder:
    return KeyFolder.new(tmp_path / "keys", [("router", None), ("model", "model"), ("agent_torso", "agent"), ("tool", "driver")])


def test_a_new_folder_has_private_files_and_identities_with_their_parties(keys: KeyFolder) -> None:
    assert stat.S_IMODE(keys.path.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in keys.path.iterdir()} == {0o600}
    assert {one.name: one.party for one in keys.issued()} == {"router": None, "model": "model", "agent_torso": "agent", "tool": "driver"}
    assert {one.days_left() for one in keys.issued()} == {364}
    keys.require(["router", "model", "agent_torso", "tool"])


def test_keys_in_use_are_not_replaced_by_new_ones(keys: KeyFolder) -> None:
    before = Identity(keys.path, "model").key.read_bytes()
    with pytest.raises(BadKeys, match="holds files already"):
        KeyFolder.new(keys.path, [("model", "model")])
    assert Identity(keys.path, "model").key.read_bytes() == before


def test_an_identity_can_be_added_and_renewed(keys: KeyFolder) -> None:
    before = Identity(keys.path, "model").certificate.read_bytes()
    keys.add([("model", "model"), ("vision", "vision")], days=20)
    assert Identity(keys.path, "model").certificate.read_bytes() != before
    assert {one.name: one.days_left() for one in keys.issued()} == {
        "router": 364,
        "agent_torso": 364,
        "tool": 364,
        "model": 19,
        "vision": 19,
    }


@pytest.mark.parametrize("name", ["ca", "A", "a b", "", "a/b", "../x"])
def test_a_name_that_could_be_no_key_of_the_bus_is_refused(keys: KeyFolder, name: str) -> None:
    with pytest.raises(BadKeys, match="cannot name an identity"):
        keys.add([(name, "client")])


def test_a_missing_identity_is_named_with_the_command_that_makes_it(keys: KeyFolder) -> None:
    with pytest.raises(BadKeys, match=r"controller.crt is missing.*`mobee keys add controller --keys "):
        keys.require(["model", "controller"])


def test_an_expired_identity_is_named_with_the_command_that_renews_it(keys: KeyFolder) -> None:
    keys.add([("model", "model")], days=-1)
    with pytest.raises(BadKeys, match=r"certificate of model .* expired on \d{4}-\d\d-\d\d: renew it with `mobee keys add model --keys "):
        keys.require(["model"])


@pytest.mark.parametrize(("name", "mode", "remedy"), [("", 0o750, "chmod 700"), ("model.key", 0o644, "chmod 600")])
def test_keys_that_others_may_read_are_refused(keys: KeyFolder, name: str, mode: int, remedy: str) -> None:
    (keys.path / name).chmod(mode)
    with pytest.raises(BadKeys, match=rf"can be read by other users \(mode {mode:03o}\): run `{remedy} "):
        keys.require(["model"])


def test_the_certificate_of_another_authority_is_refused(keys: KeyFolder, tmp_path: Path) -> None:
    other = KeyFolder.new(tmp_path / "other", [("model", "model")])
    Identity(keys.path, "model").certificate.write_bytes(Identity(other.path, "model").certificate.read_bytes())
    with pytest.raises(BadKeys, match=r"model.crt is not of the authority in"):
        keys.require(["model"])


def test_the_certificate_of_one_identity_is_not_that_of_another(keys: KeyFolder) -> None:
    for kind in ("crt", "key"):
        (keys.path / f"controller.{kind}").write_bytes((keys.path / f"tool.{kind}").read_bytes())
        (keys.path / f"controller.{kind}").chmod(0o600)
    with pytest.raises(BadKeys, match="controller.crt is the certificate of 'tool'"):
        keys.require(["controller"])


@pytest.mark.parametrize(("content", "why"), [(b"", "cannot be read as a certificate"), (b"-----BEGIN", "cannot be read as a certificate")])
def test_a_damaged_certificate_is_named(keys: KeyFolder, content: bytes, why: str) -> None:
    (keys.path / "model.crt").write_bytes(content)
    with pytest.raises(BadKeys, match=rf"model.crt {why}"):
        keys.issued()


def test_a_folder_without_an_authority_is_none_of_keys(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    with pytest.raises(BadKeys, match="is no folder of keys"):
        KeyFolder(tmp_path).issued()
    with pytest.raises(BadKeys, match=r"No such file or directory; `mobee keys new` makes a folder"):
        KeyFolder(tmp_path / "none").issued()


def test_an_identity_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("MOBEE_KEYS", "MOBEE_IDENTITY"):
        monkeypatch.delenv(name, raising=False)
    assert Identity.of_environment() is None
    monkeypatch.setenv("MOBEE_KEYS", str(tmp_path))
    assert Identity.of_environment() == Identity(tmp_path, "operator")
    assume(Identity(tmp_path, "model"))
    assert Identity.of_environment() == Identity(tmp_path, "model")
    assume(None)
    assert Identity.of_environment() is None


@pytest.mark.parametrize(
    ("endpoint", "local"),
    [
        ("tcp/127.0.0.1:7447", True),
        ("tls/localhost:7447", True),
        ("tcp/[::1]:7447", True),
        ("unixsock-stream/run/mobee", True),
        ("tcp/0.0.0.0:7447", False),
        ("tcp/[::]:7447", False),
        ("tcp/10.0.0.5:7447", False),
        ("tls/robot:7447", False),
    ],
)
def test_an_endpoint_is_local_or_others_reach_it(endpoint: str, local: bool) -> None:
    assert is_local(endpoint) is local
    assert secured(endpoint) == endpoint.replace("tcp/", "tls/")
