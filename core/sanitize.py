# SPDX-License-Identifier: Apache-2.0
"""Run a command with a build of the core (MoBeE's C++ code) that stops at the first wrong address or undefined operation.

    python core/sanitize.py [--fuzzer] COMMAND [ARGUMENT ...]

Builds this core if it is not current, and preloads the libraries of the sanitizers (run-time checks of memory and operations) into the
process of the command, because Python itself was built without them. Leaks are not reported, since Python and its packages never free some
of their memory. With --fuzzer the preloaded library is that of atheris, a fuzzer (it tests with random inputs): with the libraries of g++
it could not measure which code its inputs reach.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

from build import BuildFailed, Compiler, build, compiler_for, is_current, knowledge

RUNTIMES = ("libasan.so", "libubsan.so")
SETTINGS = {
    "ASAN_OPTIONS": "detect_leaks=0:strict_string_checks=1",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1",
    "PYTHONMALLOC": "malloc",  # each object has an address of its own, so that a read beyond its end is detected
}


def main() -> None:
    """Replace this process by the command in the arguments, which then runs with the sanitizers and the sanitized build of the core.

    If the build fails or the command cannot be started, one line says why, and the exit code is 1.
    """
    command = sys.argv[1:]
    fuzzer = command[:1] == ["--fuzzer"]
    if fuzzer:
        command = command[1:]
    if not command:
        sys.exit(f"usage: {__doc__.splitlines()[2].strip()}")  # type: ignore[union-attr]  # this file has a docstring
    try:
        level, folder = knowledge().SANITIZED, knowledge().FOLDER
        compiler = compiler_for([level])
        if not is_current(level, folder, strict=False):
            list(build([level], compiler, folder, strict=False))
        loaded = _fuzzer() if fuzzer else " ".join(_runtime(compiler, name) for name in RUNTIMES)
    except BuildFailed as failure:
        sys.exit(str(failure))
    environment = {**os.environ, **SETTINGS, "LD_PRELOAD": loaded, "MOBEE_CORE": level}
    try:
        os.execvpe(command[0], command, environment)
    except OSError as error:
        sys.exit(f"core: {command[0]} could not be started: {error.strerror}")


def _runtime(compiler: Compiler, name: str) -> str:
    """Where the compiler keeps one of its libraries; it answers with the bare name when there is none."""
    asked = [*compiler.command, f"-print-file-name={name}"]
    found = subprocess.run(asked, capture_output=True, check=True, text=True).stdout.strip()
    if found == name:
        raise BuildFailed(f"core: g++ has no {name}: install it (Debian: apt install libasan8 libubsan1, of g++'s version)")
    return found


def _fuzzer() -> str:
    """Where atheris keeps the sanitizers that it is linked with."""
    spec = importlib.util.find_spec("atheris")
    if spec is None or spec.origin is None:
        raise BuildFailed("core: --fuzzer needs atheris: pip install 'mobee[fuzz]'")
    return str(Path(spec.origin).parents[1] / "asan_with_fuzzer.so")


if __name__ == "__main__":
    main()
