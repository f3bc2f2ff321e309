"""What is kept of the trials."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any, get_type_hints

from experiments.graze.trial import COLUMNS, Trial
from experiments.kit.records import read_records

_TYPES = get_type_hints(Trial)


def as_record(trial: Trial) -> dict[str, Any]:
    """A trial as a line of the file."""
    return {name: int(value) if isinstance(value, bool) else value for name, value in asdict(trial).items()}


def read_trials(path: Path) -> list[Trial]:
    """The trials of a run so far."""
    return [Trial(**{name: _value(name, text) for name, text in row.items()}) for row in read_records(path, COLUMNS)]


def _value(name: str, text: str) -> Any:
    kind = _TYPES[name]
    return bool(int(text)) if kind is bool else kind(text)
