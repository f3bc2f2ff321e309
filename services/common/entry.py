"""How a service ends when it was given something that it cannot use: in one line."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from mobee.errors import InvalidValue, MobeeError, RobotFileError, UnknownName
from services.common.session import BusUnreachable


@contextmanager
def explained(prog: str) -> Iterator[None]:
    """Turn the project's errors into one line on standard error; exit code 2 for a mistake in what was given, else 1."""
    try:
        yield
    except (MobeeError, BusUnreachable) as error:
        print(f"{prog}: {error}", file=sys.stderr)
        raise SystemExit(2 if isinstance(error, (RobotFileError, UnknownName, InvalidValue)) else 1) from None
