# SPDX-License-Identifier: Apache-2.0
"""Settings: named fields with defaults and valid values, and the functions and classes that some of them name."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Self, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from mobee.errors import InvalidValue, UnknownName

T = TypeVar("T")
C = TypeVar("C", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Range:
    """Valid values of a number, as an annotation: `Annotated[float, Range(ge=0, lt=1)]`; NaN and infinities are never valid."""

    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None

    def holds(self, value: float | np.integer | np.floating) -> bool:
        """Return whether a number is valid."""
        return bool(
            np.isfinite(value)
            and (self.ge is None or value >= self.ge)
            and (self.gt is None or value > self.gt)
            and (self.le is None or value <= self.le)
            and (self.lt is None or value < self.lt)
        )

    def __str__(self) -> str:
        bounds = {"at least": self.ge, "above": self.gt, "at most": self.le, "below": self.lt}
        return ", ".join(f"{name} {bound:g}" for name, bound in bounds.items() if bound is not None) or "finite"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Base of the settings of an agent or a plant: a subclass states each field once, with its type, default and meaning.

    The signature of the constructor (`accepts`), the fields of a scenario file (`services.agents.config`) and the record of a run are
    made from these fields.  Values are checked against `Range` and `Literal` annotations; a field whose type allows a string beside another
    type takes a name, `module:name`, or the object itself, see `named`.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    def __post_init__(self) -> None:
        for name, hint in hints_of(type(self)).items():
            _check(name, getattr(self, name), hint)

    @classmethod
    def made(cls, settings: Self | None, changes: Mapping[str, Any]) -> Self:
        """Return the given settings, or the defaults if None, with some values replaced; raises UnknownName for a name that is no field."""
        valid = [field.name for field in fields(cls)]
        for name in changes:
            if name not in valid:
                raise UnknownName("setting", name, valid)
        return replace(cls() if settings is None else settings, **changes)


def hints_of(settings: type[Settings]) -> dict[str, Any]:
    """Return the type of each field of a class of settings by name, with its `Range` if it has one."""
    hints = get_type_hints(settings, include_extras=True)
    return {field.name: hints[field.name] for field in fields(settings)}


def accepts(settings: type[Settings]) -> Callable[[C], C]:
    """Decorate a constructor that ends in `**changes`: `inspect.signature` and `help` then list the fields of these settings."""

    def decorate(constructor: C) -> C:
        own = inspect.signature(constructor)
        defined = {field.name: field for field in fields(settings)}
        listed = [
            parameter.replace(default=defined.pop(name).default) if name in defined else parameter
            for name, parameter in own.parameters.items()
            if parameter.kind is not parameter.VAR_KEYWORD
        ]
        listed += [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=field.type)
            for name, field in defined.items()
        ]
        constructor.__signature__ = own.replace(parameters=listed)  # type: ignore[attr-defined]  # read by inspect.signature
        return constructor

    return decorate


def named(kind: str, given: str | T, table: Mapping[str, T]) -> tuple[str, T]:
    """Return the name under which a function or class is recorded, and the function or class itself.

    Args:
        kind: used in messages: "explorer", "strategy".
        given: a name in the table; `module:name` of an object that can be imported; or the object itself, which is recorded as the
            `module:name` where it was defined.
        table: the objects that have a name.

    Raises:
        UnknownName: the table has no such name.
        InvalidValue: the object cannot be imported, or it cannot be called.
    """
    if isinstance(given, str):
        require_name(kind, given, table)
        if given in table:
            return given, table[given]
        name, found = given, imported(kind, given)
    else:
        name, found = f"{getattr(given, '__module__', '?')}:{getattr(given, '__qualname__', type(given).__qualname__)}", given
    if not callable(found):
        raise InvalidValue(f"{kind} {name!r} is {found!r}, which cannot be called. Valid: {', '.join(table)}, or one of your own.")
    return name, found


def require_name(kind: str, given: str, table: Mapping[str, object]) -> None:
    """Raise UnknownName if the name is neither in the table nor of the form `module:name`; imports nothing."""
    if ":" not in given and given not in table:
        raise UnknownName(kind, given, (*table, "module:name of your own"))


def imported(kind: str, path: str) -> Any:
    """Import the object `module:name`; raises InvalidValue if it cannot be imported."""
    module, _, name = path.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InvalidValue(f"{kind} {path!r}: {error}. It must be module:name, installed or in the working directory.") from None


def _check(name: str, value: object, hint: Any) -> None:
    """Raise InvalidValue if a value is outside its `Range`, UnknownName if it is none of its `Literal` values."""
    metadata = getattr(hint, "__metadata__", ())
    kind = get_args(hint)[0] if metadata else hint
    if get_origin(kind) is Literal and value not in get_args(kind):
        raise UnknownName(name, value, get_args(kind))
    for valid in metadata:
        if isinstance(valid, Range) and not (isinstance(value, int | float | np.integer | np.floating) and valid.holds(value)):
            raise InvalidValue(f"{name}={value!r}: valid is a number {valid}.")
