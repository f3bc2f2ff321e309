# SPDX-License-Identifier: Apache-2.0
"""Run a module of the system: `python -m mobee_system.run services.model --help`.

The command does the same as `python -m services.model --help`. It also works in a folder that has a package `services` of its own.
"""

from __future__ import annotations

import runpy
import sys


def main() -> None:
    """Run a module as the main program (`__main__`). The first argument is the module's name, the others are arguments for the module."""
    if len(sys.argv) < 2:
        sys.exit("usage: python -m mobee_system.run MODULE [arguments]")
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
