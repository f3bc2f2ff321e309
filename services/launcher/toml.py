"""Writes settings as TOML."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def to_toml(tables: Mapping[str, Any], prefix: str = "") -> str:
    """The text that `tomllib` reads back as these tables; a value of None is left out."""
    plain = {key: value for key, value in tables.items() if value is not None and not isinstance(value, Mapping)}
    nested = {key: value for key, value in tables.items() if isinstance(value, Mapping)}
    lines = [f"{_key(key)} = {_value(value)}\n" for key, value in plain.items()]
    header = f"[{prefix}]\n" if prefix and (plain or not nested) else ""
    parts = [header + "".join(lines)]
    parts += [to_toml(value, f"{prefix}.{_key(key)}".lstrip(".")) for key, value in nested.items()]
    return "\n".join(part for part in parts if part)


def _key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    return repr(value)
