"""The files that hold machine code: one for each function and signature, written in one step, with a checksum.

This stands in for Numba's own files because those have no checksum, must be writable to be read, and end up beside the sources
when they are not.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from mobee.engine.cache import others, stamp

_CHECKSUM = 32  # bytes at the start of a file


_rebuild: Any = CompileResult._rebuild  # Numba's type information ends here
_bytes: Any = dumps


class Shelf(NullCache):
    """The machine code of one function, as Numba's dispatcher asks for it."""

    unwritten: OSError | None = None  # why the first file that could not be written was not; of all shelves

    def __init__(self, function: Callable[..., object], folder: Path) -> None:
        self._folder = folder
        self._function = function

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(self._folder)

    def load_overload(self, sig: object, target_context: Any) -> object:
        """The compiled function from its file; None if there is none, or not as it was written."""
        target_context.refresh()
        path = self._path(sig, target_context.codegen())
        content = _content(path)
        if content is None:
            return None
        payload = content[_CHECKSUM:]
        if hashlib.sha256(payload).digest() != content[:_CHECKSUM]:
            return None
        return _rebuild(target_context, *pickle.loads(payload))

    def save_overload(self, sig: object, data: Any) -> None:
        """Write the file of a compiled function; where that fails the function works all the same."""
        payload = _bytes(data._reduce())
        path = self._path(sig, data.codegen)
        new = path.with_name(f"{path.name}.{uuid.uuid4().hex[:8]}")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            new.write_bytes(hashlib.sha256(payload).digest() + payload)
            os.replace(new, path)
        except OSError as error:
            Shelf.unwritten = Shelf.unwritten or error
            with contextlib.suppress(OSError):
                new.unlink()

    def _path(self, sig: object, codegen: Any) -> Path:
        code = self._function.__code__
        parts = (sig, codegen.magic_tuple(), stamp(code.co_filename), code.co_firstlineno)
        digest = hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()
        return self._folder / f"{self._function.__name__}-{digest[:16]}"


def _content(path: Path) -> bytes | None:
    """What a file holds; one that only the folder of another version has is taken over from there."""
    with contextlib.suppress(OSError):
        return path.read_bytes()
    with contextlib.suppress(OSError):
        for folder in others(path.parent):
            if (folder / path.name).exists():
                path.parent.mkdir(exist_ok=True)
                os.link(folder / path.name, path)
                return path.read_bytes()
    return None
