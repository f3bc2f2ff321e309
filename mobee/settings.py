# SPDX-License-Identifier: Apache-2.0
"""Settings of agents and plants: named fields with defaults and valid values; a value may be the name of a function or class."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from operator import attrgetter
from typing import Any, Literal, Self, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from mobee.errors import InvalidValue, UnknownName

T = TypeVar("T")
C = TypeVar("C", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Range:
    """The valid values of a number, for an annotation: `Annotated[float, Range(ge=0, lt=1)]`; NaN and infinities are never valid.

    `ge`, `gt`: lower bound that is included, excluded. `le`, `lt`: upper bound that is included, excluded. None: no such bound.
    """

    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None

    def holds(self, value: float | np.integer | np.floating) -> bool:
        """Return whether a number is finite and within all bounds."""
        return bool(
            (isinstance(value, int) or np.isfinite(value))  # NumPy has no whole number of 2^64 or more
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
    """The base class of the settings of an agent or a plant: a subclass states each field once, with its type, default and meaning.

    From these fields come the signature of the constructor that takes the settings (`mobee.settings.accepts`), the fields of a scenario
    file (`services.agents.config`) and the settings that are recorded with a run.  Values are checked against `Range` and `Literal`
    annotations.  A field for a function or class can be set by its short name, by `module:name`, or by the function or class itself
    (`mobee.settings.named`).

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    def __post_init__(self) -> None:
        for name, hint in hints_of(type(self)).items():
            value = getattr(self, name)
            if isinstance(value, np.generic):  # no JSON value: it could not be recorded
                object.__setattr__(self, name, value := value.item())
            _check(name, value, hint)

    @classmethod
    def made(cls, settings: Self | None, changes: Mapping[str, Any]) -> Self:
        """Return a copy of `settings`, or the default settings if None, with the values in `changes` (by name of the field) replaced.

        Raises UnknownName for a name that is not a field, InvalidValue for a value out of range.
        """
        valid = [field.name for field in fields(cls)]
        for name in changes:
            if name not in valid:
                raise UnknownName("setting", name, valid)
        return replace(cls() if settings is None else settings, **changes)


def hints_of(settings: type[Settings]) -> dict[str, Any]:
    """Return a dict from the name of each field of a settings class to its type; the type includes the `Range` annotation, if any."""
    hints = get_type_hints(settings, include_extras=True)
    return {field.name: hints[field.name] for field in fields(settings)}


def accepts(settings: type[Settings]) -> Callable[[C], C]:
    """Return a decorator for a constructor whose last argument is `**changes`: `help` on it then lists the fields of `settings`."""

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
    """Return the name under which a function or class is recorded in the settings of a run, and the function or class itself.

    Args:
        kind: what is named, for the messages: "explorer", "strategy".
        given: a name in `table`; or `module:name` of a function or class that can be imported; or the function or class itself,
            which is recorded as the `module:name` where it was defined.
        table: the functions and classes that have a short name, by this name.

    Raises:
        UnknownName: `given` is neither a name in the table nor of the form `module:name`.
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
    """Raise UnknownName if `given` is neither a name in the table nor of the form `module:name`; nothing is imported.

    `kind`: what is named, such as "detector", for the error message.
    """
    if ":" not in given and given not in table:
        raise UnknownName(kind, given, (*table, "module:name of your own"))


def imported(kind: str, path: str) -> Any:
    """Import and return the object that `path` names as `module:name`; raises InvalidValue if it cannot be imported.

    `kind`: what the object is, such as "detector", for the error message. The name may be one within a class, as `module:Class.name`.
    """
    module, _, name = path.partition(":")
    try:
        return attrgetter(name)(importlib.import_module(module))
    except (ImportError, AttributeError, ValueError) as error:
        raise InvalidValue(f"{kind} {path!r}: {error}. It must be module:name, installed or in the working directory.") from None


def _check(name: str, value: object, hint: Any) -> None:
    """Raise InvalidValue for a value outside its `Range`, or not of the type int or bool; UnknownName if it is no `Literal` value."""
    metadata = getattr(hint, "__metadata__", ())
    kind = get_args(hint)[0] if metadata else hint
    if kind is bool and not isinstance(value, bool):
        raise InvalidValue(f"{name}={value!r}: valid is True or False.")
    if kind is int and (isinstance(value, bool) or not isinstance(value, int)):
        raise InvalidValue(f"{name}={value!r}: valid is a whole number{', '.join(['', *map(str, metadata)])}.")
    if get_origin(kind) is Literal and value not in get_args(kind):
        raise UnknownName(name, value, get_args(kind))
    for valid in metadata:
        if isinstance(valid, Range) and not (isinstance(value, int | float | np.integer | np.floating) and valid.holds(value)):
            raise InvalidValue(f"{name}={value!r}: valid is a number {valid}.")
