"""docs/bus.md speaks of everything that is on the bus."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest
from msgspec import Struct

from bus_schema import chain, keys, messages, rpc

TEXT = (Path(__file__).parents[2] / "docs" / "bus.md").read_text()
WORDS = set(re.findall(r"`([^`]+)`", TEXT))
BASES = {messages.Message, rpc.Request, rpc.Reply}
STRUCTS = {
    name: cls
    for module in (messages, chain, rpc)
    for name, cls in inspect.getmembers(module, inspect.isclass)
    if issubclass(cls, Struct) and cls not in BASES and cls.__module__ == module.__name__
}
KEYS = [name for name, thing in vars(keys).items() if name != "chunk" and (inspect.isfunction(thing) or name.isupper()) and name[0] != "_"]


@pytest.mark.parametrize("name", STRUCTS)
def test_every_message_is_named(name: str) -> None:
    assert name in WORDS


@pytest.mark.parametrize("name", KEYS)
def test_every_key_is_named(name: str) -> None:
    assert name in WORDS


def test_every_constant_key_is_written_out() -> None:
    constants = [value for name, value in vars(keys).items() if name.isupper() and isinstance(value, str) and "*" not in value]
    assert [key for key in constants if key not in WORDS] == []
