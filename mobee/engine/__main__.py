"""`python -m mobee.engine`: compile the engine, if need be, and print where its machine code is."""

from __future__ import annotations

from mobee.engine.load import load

if __name__ == "__main__":
    load()

    from mobee.engine.compiled import FOLDER

    print(FOLDER)
