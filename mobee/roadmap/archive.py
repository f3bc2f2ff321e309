"""A map on disk: one .npz of plain arrays, with what is not an array as JSON; written whole or not at all."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.errors import MobeeError

FORMAT = "mobee-roadmap 1"
Arrays = dict[str, NDArray[Any]]


def write(path: str | Path, arrays: Mapping[str, NDArray[Any]], notes: Mapping[str, Any]) -> None:
    """Write arrays of numbers and notes, plain JSON; whoever reads meanwhile, or after a crash, finds the old file or the new one.

    Raises MobeeError where the file cannot be written.
    """
    place = Path(path)
    part = place.with_name(f".{place.name}.{os.getpid()}.part")
    text = json.dumps({"format": FORMAT, **notes}, allow_nan=False)
    try:
        try:
            with part.open("wb") as file:
                np.savez(file, allow_pickle=False, notes=np.frombuffer(text.encode(), dtype=np.uint8), **arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, place)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise MobeeError(f"{place}: the map cannot be written ({error.strerror or error}).") from error


def read(path: str | Path) -> tuple[Arrays, dict[str, Any]]:
    """What was written: the arrays, and the notes; raises MobeeError, in one line, for any other file."""
    place = Path(path)
    try:
        with place.open("rb") as raw:
            if not zipfile.is_zipfile(raw):
                raise ValueError("it is no .npz file, or its end is missing")
        with np.load(place, allow_pickle=False) as file:
            arrays: Arrays = {name: file[name] for name in file.files}
        notes = json.loads(arrays.pop("notes").tobytes())
        found = notes.pop("format")
    except FileNotFoundError:
        raise MobeeError(f"{place}: there is no such file. `mobee roadmap build` makes maps.") from None
    except OSError as error:
        raise MobeeError(f"{place}: the map cannot be read ({error.strerror or error}).") from error
    except (ValueError, KeyError, AttributeError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise MobeeError(
            f"{place}: no roadmap, or only a part of one ({_line(error)}). Give another file, or remove it and build it anew."
        ) from error
    if found != FORMAT:
        raise MobeeError(f"{place}: written as {found!r}, this mobee reads {FORMAT!r}. Use the version that wrote it, or build it anew.")
    return arrays, notes


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
