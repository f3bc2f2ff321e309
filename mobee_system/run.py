# SPDX-License-Identifier: Apache-2.0
"""Run a module of the system: `python -m mobee_system.run services.model --help`.

The command does the same as `python -m services.model --help`. It also works in a folder that has a package `services` of its own.
"""

from __future__ import annotations

import runpy
import sys
from importlib.util import find_spec


def main() -> None:
    """Run a module as the main program (`__main__`). The first argument is the module's name, the others are arguments for the module."""
    if len(sys.argv) < 2:
        sys.exit("usage: python -m mobee_system.run MODULE [arguments]")
    if not _is_program(sys.argv[1]):
        sys.exit(f"no module {sys.argv[1]!r} can be run: give the name of a program of the system, such as services.model")
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


def _is_program(name: str) -> bool:
    try:
        found = find_spec(name)
        return found is not None and (found.submodule_search_locations is None or find_spec(f"{name}.__main__") is not None)
    except ModuleNotFoundError as error:
        if f"{name}.".startswith(f"{error.name}."):  # the module itself, or a package of its name
            return False
        raise  # it needs a package that is not installed
    except (ImportError, ValueError):  # not a name
        return False


if __name__ == "__main__":
    main()
