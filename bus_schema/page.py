# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of docs/bus.md from the messages: `python -m bus_schema.page`."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Literal, get_args, get_origin

from msgspec import Struct

from bus_schema import messages, rpc
from bus_schema.messages import Message
from bus_schema.rpc import CALLS, Reply, Request
from bus_schema.stream import DELIVERIES, EVERYONE, Party

PAGE = Path(__file__).parents[1] / "docs" / "bus.md"
BASES: tuple[type[Struct], ...] = (Message, Request, Reply)
_MARKED = re.compile(r"(<!-- begin (\w+)[^\n]*-->\n).*?(<!-- end \2 -->)", re.DOTALL)
_FIELD = re.compile(r"    (\w+): (.+?)(?: = (.+?))?(?:  # (.*))?$")
_BOUNDED = re.compile(r"Annotated\[(.+), Meta\((.+)\)\]$")
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


def main() -> None:
    """Replace the generated tables in docs/bus.md by new ones."""
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


def with_tables(page: str) -> str:
    """Return `page`, the text of docs/bus.md, with a new table between each pair of the comments `begin NAME` and `end NAME`.

    Raises KeyError if there is no table with this NAME.
    """
    tables = {
        "deliveries": _deliveries,
        "streams": _streams,
        "calls": _calls,
        "literals": _literals,
        "messages": _messages,
        "requests": _requests,
    }
    return _MARKED.sub(lambda match: f"{match[1]}{tables[match[2]]()}{match[3]}", page)


def structs(module: ModuleType) -> list[type[Struct]]:
    """Return the structs that `module` defines, in the order of the source, without the three base classes in BASES.

    `module`: `bus_schema.messages` (all messages, and the structs inside them) or `bus_schema.rpc` (all requests and replies, likewise).
    """
    own = (cls for cls in vars(module).values() if isinstance(cls, type) and cls.__module__ == module.__name__)
    return [cls for cls in own if issubclass(cls, Struct) and cls not in BASES]


def streams() -> list[type[Message]]:
    """Return the classes of all messages that have a stream, that is, a key on the bus, in the order of the source."""
    return [cls for cls in structs(messages) if issubclass(cls, Message)]


def _deliveries() -> str:
    return _table(("class", "what happens to a message"), ((name, text) for name, text in DELIVERIES.items()))


def _streams() -> str:
    rows = ((f"`{cls.stream.pattern}`", f"[`{cls.__name__}`](#{_anchor(cls)})", cls.stream) for cls in streams())
    return _table(
        ("key", "message", "who may write it", "when", "who reads it", "delivery"),
        ((key, name, _listed(s.writers), s.when or "-", _listed(s.readers) or "-", s.delivery) for key, name, s in rows),
    )


def _calls() -> str:
    rows = []
    for call in CALLS:
        keys = [f"`{call.pattern.replace('{verb}', verb)}`" for verb in call.verbs or ("",)]
        rows.append(
            (", ".join(keys), f"`{call.request.__name__}`", f"`{call.reply.__name__}`", _listed(call.servers), _listed(call.callers))
        )
    return _table(("key", "request", "reply", "who answers", "who may call"), rows)


def _listed(parties: Sequence[Party]) -> str:
    return "all" if parties == EVERYONE else ", ".join("agents" if party == "agent" else party for party in parties)


def _literals() -> str:
    """Return a table of the aliases whose values are fixed words, and the fields that have them."""
    rows = []
    for name, alias in vars(messages).items():
        if get_origin(alias) is Literal:
            values = ", ".join(f"`{value}`" for value in get_args(alias))
            fields = [f"`{cls.__name__}.{field}`" for cls, field, kind in _annotations() if kind == name]
            if fields:
                rows.append((f"`{name}`", values, ", ".join(fields)))
    return _table(("type", "values", "fields"), rows)


def _annotations() -> list[tuple[type[Struct], str, str]]:
    """Return the structs with the fields that each declares itself, and the type of each field as in the source."""
    every = (*structs(messages), *structs(rpc))
    return [(cls, field, str(kind)) for cls in every for field, kind in vars(cls).get("__annotations__", {}).items()]


def _messages() -> str:
    return _described(Message) + "".join(map(_described, structs(messages)))


def _requests() -> str:
    return _described(Request) + _described(Reply) + "".join(map(_described, structs(rpc)))


def _described(cls: type[Struct]) -> str:
    fields = _fields(cls)
    return f"### {cls.__name__}\n\n{_docstring(cls)}\n\n" + (f"{fields}\n" if fields else "")


def _docstring(cls: type[Struct]) -> str:
    return " ".join((inspect.getdoc(cls) or "").split())


def _anchor(cls: type[Struct]) -> str:
    return cls.__name__.lower()


def _fields(cls: type[Struct]) -> str:
    """Return a table of the fields that the class itself declares, with the comments of the source."""
    rows = []
    for line in inspect.getsource(cls).splitlines():
        match = _FIELD.match(line)
        if match and match[1] in cls.__struct_fields__:
            rows.append((f"`{match[1]}`", _kind(match[2]), match[4] or ""))
    return _table(("field", "type", "unit, meaning"), rows) if rows else ""


def _kind(annotation: str) -> str:
    """Return the type of a field, with its bounds instead of Annotated[..., Meta(...)]."""
    match = _BOUNDED.match(annotation)
    if match is None:
        return annotation.replace("|", "\\|")
    bounds = (bound.split("=") for bound in match[2].split(", "))
    return f"{match[1]} " + ", ".join(f"{_SIGNS.get(name, name)} {value}" for name, value in bounds)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


if __name__ == "__main__":
    main()
