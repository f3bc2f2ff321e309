# SPDX-License-Identifier: Apache-2.0
"""docs/bus.md and the code: the tables are current, and the services write, read and answer what the contract names."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from bus_schema import keys, messages, page, rpc
from bus_schema.messages import Message
from bus_schema.rpc import CALLS
from bus_schema.stream import EVERYONE

ROOT = Path(__file__).parents[2]
SHARED = {
    "bus_plant.py": "agent",
    "reach_client.py": "agent",
    "behaviour.py": "behaviour",
    "followed_part.py": "behaviour",
}  # files of services/common that one service uses
FOLDERS = {"agents": "agent", "gaze": "behaviour", "assist": "behaviour", "cup": "client"}  # whose parties have another name
READ_ALL = ("", "operator", "client")
IMPLIED = {"on_clock": "Clock", "on_tick": "Tick", "Body": "State", "StopLine": "EStop"}  # functions that read one stream
PROGRAMS = {"client", "driver"}  # of a user, outside of this repository
MIRRORS = "port_filter"  # publishes the robot's own streams to its clients


def test_the_tables_are_current() -> None:
    text = page.PAGE.read_text()
    assert page.with_tables(text) == text, "run `python -m bus_schema.page`"


def test_an_unknown_table_is_an_error() -> None:
    with pytest.raises(KeyError, match="nothing"):
        page.with_tables("<!-- begin nothing -->\n<!-- end nothing -->")


def test_bounds_of_a_field_are_written_as_signs() -> None:
    assert page._kind("Annotated[float, Meta(gt=0, le=1)]") == "float > 0, <= 1"
    assert page._kind("Answer | None") == "Answer \\| None"


def test_every_field_of_a_message_has_a_row() -> None:
    for cls in (*page.structs(messages), *page.structs(rpc)):
        inherited = {name for base in cls.__bases__ for name in getattr(base, "__struct_fields__", ())}
        assert all(f"| `{name}` |" in page._fields(cls) for name in cls.__struct_fields__ if name not in inherited), cls


def test_no_two_messages_have_one_key() -> None:
    patterns = [cls.stream.pattern for cls in page.streams()]
    assert len(set(patterns)) == len(patterns)


def test_every_call_has_a_function_that_makes_its_key() -> None:
    made = {
        keys.meta("p"), keys.ESTOP_RESET, keys.MODEL_JACOBIAN, keys.waypoint("p"),
        *(make(*first, verb) for make, first in MAKERS for call in CALLS for verb in call.verbs),
    }  # fmt: skip
    for call in CALLS:
        for verb in call.verbs or ("",):
            key = call.pattern.format(service="s", part="p", verb=verb)
            assert key in made, key


MAKERS = ((keys.drive, ("p",)), (keys.goal, ("p",)), (keys.sim, ()), (keys.world_rpc, ()), (keys.service_rpc, ("s",)))


def service_of(path: Path) -> str:
    """Return the party whose code a file is; operator and clients read all streams, so the readers of `found` are services alone."""
    if path.is_relative_to(ROOT / "mobee_cli"):
        return "operator"
    folder = path.relative_to(ROOT / "services").parts[0]
    if folder == "common":
        return SHARED.get(path.name, "")
    return "renderer" if path.name.startswith("renderer") else FOLDERS.get(folder, folder)


def calls(tree: ast.AST) -> Iterator[tuple[str, list[ast.expr]]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute | ast.Name):
            yield node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id, node.args


@cache
def found() -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """Writers and readers of each message by the code of services and commands."""
    writers, readers = defaultdict(set), defaultdict(set)
    for path in (path for folder in ("services", "mobee_cli") for path in (ROOT / folder).rglob("*.py")):
        service, tree = service_of(path), ast.parse(path.read_text())
        modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        imports = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module == "bus_schema.messages")
        aliases = {name.asname or name.name: name.name for node in imports for name in node.names}
        for method, arguments in calls(tree):
            name = aliases.get(arguments[0].id) if arguments and isinstance(arguments[0], ast.Name) else None
            if name and service and method == "publisher":
                writers[name].add(service)
            elif name and service not in READ_ALL and method in ("on_newest", "on_each", "latest"):
                readers[name].add(service)
            if service not in READ_ALL and method in IMPLIED and (method != "Body" or "services.common.body" in modules):
                readers[IMPLIED[method]].add(service)
    return writers, readers


@pytest.mark.parametrize("cls", page.streams(), ids=lambda cls: cls.__name__)
def test_the_services_write_and_read_the_streams_of_the_contract(cls: type[Message]) -> None:
    writers, readers = (each[cls.__name__] for each in found())
    if cls.__name__ not in ("Turn", "StepDone", "Event", "Served"):  # which all services write and read, through services/common
        assert writers - {MIRRORS} == set(cls.stream.writers) - PROGRAMS - {MIRRORS} or cls.stream.writers == EVERYONE
        assert readers - {MIRRORS} == set(cls.stream.readers) - PROGRAMS - {MIRRORS} or cls.stream.readers == EVERYONE
