# SPDX-License-Identifier: Apache-2.0
"""Formats the results of an experiment as text for a terminal: a line for each value, and a table for dicts with the same keys in a row."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

GAP = 2  # spaces between the columns of a table
STEP = 2  # spaces that a level is farther in


def results_text(results: Mapping[str, Any], width: int) -> str:
    """Return results (JSON data) as text for a terminal. Lines have at most `width` characters, unless a single word is longer."""
    return "\n".join(_entries(results, "", width))


def _entries(results: Mapping[str, Any], indent: str, width: int) -> Iterator[str]:
    for columns, group in groupby(results.items(), key=lambda entry: _columns(entry[1])):
        rows = dict(group)
        if columns and len(rows) > 1:
            yield from _table([_words(label) for label in rows], list(rows.values()), columns, indent, width)
        else:
            for key, value in rows.items():
                yield from _entry(_words(key), value, indent, width)


def _columns(value: Any) -> tuple[str, ...]:
    """Return the column names of a table's row; () if the value is not a row."""
    return tuple(value) if isinstance(value, dict) and not any(isinstance(cell, dict) for cell in value.values()) else ()


def _entry(label: str, value: Any, indent: str, width: int) -> Iterator[str]:
    if isinstance(value, list) and value and all(map(_columns, value)):
        yield f"{indent}{label}:"
        names = list(dict.fromkeys(name for row in value for name in row))
        count = _needed([[_cell(row.get(name)) for name in names] for row in value])
        stubs = _aligned([list(map(_words, names[:count])), *([_cell(row.get(name)) for name in names[:count]] for row in value)])
        yield from _table(stubs[1:], value, names[count:], indent + " " * STEP, width, stubs[0])
        return
    if not isinstance(value, dict) or not value:
        yield textwrap.fill(
            f"{label}: {_cell(value)}",
            width,
            initial_indent=indent,
            subsequent_indent=f"{indent}{' ' * STEP}",
            break_long_words=False,
            break_on_hyphens=False,
        )
        return
    yield f"{indent}{label}:"
    yield from _entries(value, indent + " " * STEP, width)


def _needed(rows: Sequence[Sequence[str]]) -> int:
    """Return the number of leading cells that make all rows different; 1 if no number does."""
    return next((count for count in range(1, len(rows[0]) + 1) if len({tuple(row[:count]) for row in rows}) == len(rows)), 1)


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines of cells side by side, each cell as wide as the widest of its column."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [(" " * GAP).join(cell.ljust(wide) for cell, wide in zip(row, widths, strict=True)) for row in rows]


def _table(
    labels: Sequence[str], rows: Sequence[Mapping[str, Any]], columns: Sequence[str], indent: str, width: int, head: str = ""
) -> Iterator[str]:
    """Yield a row per result, below the names of its columns, one word per line; `head`: the name of the labels."""
    stub = len(indent) + max(map(len, [head, *labels]))
    cells = {name: [_cell(row.get(name)) for row in rows] for name in columns}
    widths = {name: max(map(len, [*_words(name).split(), *cells[name]])) for name in columns}
    for block in _blocks(columns, widths, width - stub):
        heads = [_words(name).split() for name in block]
        height = max(map(len, heads), default=1)
        lines = list(zip(*([""] * (height - len(words)) + words for words in heads), strict=True)) or [()]
        for line in lines[:-1]:
            yield (" " * stub + _line(line, block, widths)).rstrip()
        yield (f"{indent}{head}".ljust(stub) + _line(lines[-1], block, widths)).rstrip()
        for i, label in enumerate(labels):
            yield f"{indent}{label}".ljust(stub) + _line([cells[name][i] for name in block], block, widths)


def _blocks(columns: Sequence[str], widths: Mapping[str, int], room: int) -> Iterator[list[str]]:
    """Yield groups of columns that fit side by side, one group for each table."""
    block: list[str] = []
    taken = 0
    for name in columns:
        if block and taken + GAP + widths[name] > room:
            yield block
            block, taken = [], 0
        block.append(name)
        taken += GAP + widths[name]
    yield block


def _line(cells: Sequence[str], block: Sequence[str], widths: Mapping[str, int]) -> str:
    return "".join(" " * GAP + cell.rjust(widths[name]) for cell, name in zip(cells, block, strict=True))


def _words(name: str) -> str:
    return str(name).replace("_deg_s", " deg/s").replace("_", " ")


def _cell(value: Any) -> str:
    if isinstance(value, list | tuple | dict):
        return ", ".join(map(_cell, value)) or "none"  # a dict here is an empty one
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
