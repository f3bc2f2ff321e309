"""Build the native core: one shared library for each level of x86-64 processors, of all sources at once.

    python core/build.py [--only x86-64-v3] [--into FOLDER] [--sanitize]

Uses the system's g++ or clang++ where it is new enough, else the compiler of the `ziglang` package.  Nothing is linked but the C
library, so that the result runs wherever the C library is at least as old.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
INTO = HERE.parent / "mobee" / "_core"
LEVELS = {"x86_64": ("x86-64-v2", "x86-64-v3", "x86-64-v4")}
# Strict arithmetic: every level, every compiler and any number of threads give the same bits.
FLAGS = (
    "-std=c++20", "-O3", "-fPIC", "-fno-exceptions", "-fno-rtti", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math",
    "-fvisibility=hidden", "-Wno-psabi", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror",
)  # fmt: skip


def sources() -> list[Path]:
    """All source files, in the order in which they are compiled."""
    return sorted(HERE.rglob("*.cpp"))


def build(level: str, into: Path, sanitize: bool = False) -> Path:
    """Compile and link one library; raises CalledProcessError, with the compiler's words on standard error."""
    into.mkdir(parents=True, exist_ok=True)
    library = into / f"core-{level}.so"
    with tempfile.TemporaryDirectory() as scratch:
        whole = Path(scratch) / "core.cpp"
        whole.write_text("".join(f'#include "{source}"\n' for source in sources()))
        march = [] if level == "generic" else [f"-march={level}"]
        extra = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O1"] if sanitize else []
        command = [*compiler(), *FLAGS, *march, *extra, f"-I{HERE}", "-shared", str(whole), "-o", f"{library}.new", "-lm"]
        subprocess.run(command, check=True)
    Path(f"{library}.new").replace(library)
    return library


def compiler() -> list[str]:
    """The command that compiles C++20 here."""
    for name in ("g++", "clang++"):
        if shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "c++"]


def main() -> None:
    """Build what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", help="one level instead of all")
    parser.add_argument("--into", type=Path, default=INTO)
    parser.add_argument("--sanitize", action="store_true", help="with the address and undefined sanitizers")
    given = parser.parse_args()
    levels = (given.only,) if given.only else LEVELS.get(platform.machine(), ("generic",))
    start = time.monotonic()
    with concurrent.futures.ThreadPoolExecutor() as pool:
        for library in pool.map(lambda level: build(level, given.into, given.sanitize), levels):
            print(f"{library.name}: {library.stat().st_size / 1024:.0f} kB, after {time.monotonic() - start:.1f} s")


if __name__ == "__main__":
    main()
