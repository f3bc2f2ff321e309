# SPDX-License-Identifier: Apache-2.0
"""Keys hold plain chunks only: a wildcard in a put would reach every matching subscriber."""

from __future__ import annotations

import inspect

import pytest

from bus_schema import keys
from bus_schema.page import streams
from bus_schema.stream import Stream

BAD = ["*", "**", "a*", "left arm", " ", "", "Left", "a/b", "/", "a$*", "ä", "a-b", "a\n", "#", "?"]
FUNCTIONS = [f for name, f in inspect.getmembers(keys, inspect.isfunction) if name != "chunk" and name[0] != "_"]
STREAMS = [cls.stream for cls in streams()]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_no_key_is_made_of_a_bad_chunk(function: object, bad: str) -> None:
    assert callable(function)
    arity = len(inspect.signature(function).parameters)
    for at in range(arity):
        arguments = ["a"] * arity
        arguments[at] = bad
        if bad == "*" and function in (keys.drive, keys.goal, keys.waypoint) and at == 0:
            continue  # a server declares them for all parts at once
        with pytest.raises(ValueError, match="a-z, 0-9 and _"):
            function(*arguments)


@pytest.mark.parametrize("stream", [one for one in STREAMS if one.variable], ids=lambda one: one.pattern)
def test_a_key_to_write_has_no_wildcard_and_one_to_read_may_have(stream: Stream) -> None:
    for bad in BAD:
        with pytest.raises(ValueError, match="a-z, 0-9 and _"):
            stream.key(bad)
    assert stream.key("a") == stream.keys("a") == stream.pattern.replace(f"{{{stream.variable}}}", "a")
    assert stream.keys() == stream.pattern.replace(f"{{{stream.variable}}}", "*")


def test_only_servers_of_all_parts_may_write_one_wildcard() -> None:
    assert keys.drive("*", "take") == "*/rpc/drive/take"
    assert keys.goal("*", "take") == "*/rpc/take"
    assert keys.waypoint("*") == "*/rpc/waypoint"


def test_no_two_functions_make_the_same_key() -> None:
    made = [f(*["a"] * len(inspect.signature(f).parameters)) for f in FUNCTIONS]
    same = {keys.goal("a", "a"), keys.service_rpc("a", "a")}  # parts and services have different names
    assert len(set(made)) == len(made) - 1
    assert len(same) == 1
