"""Rows of a file of records: one dataclass says columns and types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self


@dataclass(frozen=True, slots=True)
class Row:
    """To be derived from: fields are texts, floats and booleans."""

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Of the file."""
        return tuple(field.name for field in fields(cls))

    def record(self) -> dict[str, object]:
        """For the file; numbers to six places."""
        values = {name: getattr(self, name) for name in self.columns()}
        return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Self:
        """From the file."""
        read: dict[str, Any] = {"float": float, "bool": "True".__eq__, "str": str}
        return cls(**{field.name: read[str(field.type)](row[field.name]) for field in fields(cls)})
