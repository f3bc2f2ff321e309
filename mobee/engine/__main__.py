"""`python -m mobee.engine`: compile the engine, if need be, and print where its machine code is."""

from __future__ import annotations

import sys

from mobee.engine.load import load

INTERRUPTED = 130  # as of a shell: 128 and the number of SIGINT

if __name__ == "__main__":
    try:
        load()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)

    from mobee.engine.compiled import FOLDER

    print(FOLDER)
