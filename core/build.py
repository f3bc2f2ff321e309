# SPDX-License-Identifier: Apache-2.0
"""Build the native core: a shared library for each level (set of features) of x86-64 processors on Linux, a single one on other machines.

    python core/build.py [--only x86-64-v3 | --here] [--into FOLDER] [--sanitize] [--no-strict] [--force] [--check]

The compiler is the one that $CXX names. If it is not set, it is the first of g++, clang++ and the one of the package `ziglang` that is
installed and compiles C++20. A library needs no other library than the C library, so it runs on every system with a C library that is not
older. A library that was built from the same sources is not built again.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import importlib.util
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

HERE = Path(__file__).resolve().parent
COMPILER_LOCK = HERE / "compiler.lock"  # the version of ziglang, with its hashes

# Strict arithmetic: every level, every compiler and any number of threads give the same bits.
FLAGS = (
    "-std=c++20", "-O3", "-fPIC", "-fno-exceptions", "-fno-rtti", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math",
    "-fvisibility=hidden", "-pthread", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wno-psabi",
)  # fmt: skip
SANITIZE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer", "-g", "-O1")
PROBE = """
#include <bit>
#include <cmath>
#include <numbers>
#include <span>
template <class T> concept Number = requires(T a) { a + a; };
template <Number T> T sum(std::span<const T> all) { T total{}; for (T one : all) total += one; return total; }
double probe(std::span<const double> all) { return std::sin(sum(all)) + std::numbers::pi + std::popcount(all.size()); }
"""
OLDEST_GLIBC = (2, 17)  # whose headers zig compiles with, and which the oldest wheel is for
NO_COMPILER = 3  # exit code


class BuildFailed(Exception):
    """The build failed; the message is one line, printed below the messages of the compiler, if it was started."""


class CompilerMissing(BuildFailed):
    """Raised if this machine has no compiler of C++20: neither g++, clang++ nor the package ziglang."""

    def __init__(self) -> None:
        super().__init__(
            "core: the library needs a compiler of C++20 (g++ 11, clang++ 12 or newer) or the package ziglang, which holds one: "
            f"install g++ with the system's packages (Debian: apt install g++), or pip install {zig_requirement()}"
        )


@dataclass(frozen=True)
class Compiler:
    """A compiler: `command` is the program with its first arguments; `zig` is whether it is the one of the package ziglang.

    Of zig only the compiler and the linker are used: it would compile its runtime and its C library from source, which takes minutes.
    """

    command: tuple[str, ...]
    zig: bool = False

    @property
    def name(self) -> str:
        """Short name of the compiler for messages to the user: "zig", or the file name of its command, such as "g++"."""
        return "zig" if self.zig else Path(self.command[0]).name


def main() -> None:
    """Build the libraries of the core that the options name and that are not current; all levels of this machine without an option.

    If that fails, one line says why, and the exit code is not 0. With --check nothing is built; the exit code is 1 if a library is not
    current.
    """
    levels = knowledge().machine_levels()
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", choices=levels, help="one level instead of all")
    parser.add_argument("--here", action="store_true", help="the widest level that this processor runs, instead of all")
    parser.add_argument("--into", type=Path, help="another folder than the library's")
    parser.add_argument("--sanitize", action="store_true", help="one build that stops at wrong addresses and undefined operations")
    parser.add_argument("--strict", action=argparse.BooleanOptionalAction, default=True, help="whether warnings are errors")
    parser.add_argument("--force", action="store_true", help="build anew what is current, too")
    parser.add_argument("--check", action="store_true", help="only look: exit code 1 if something is to be built")
    given = parser.parse_args()
    into = given.into or knowledge().FOLDER
    try:
        wanted = [knowledge().SANITIZED] if given.sanitize else [given.only] if given.only else level_here() if given.here else levels
        stale = [level for level in wanted if given.force or not is_current(level, into, strict=given.strict)]
        if given.check or not stale:
            sys.exit(1 if stale else 0)
        start = time.monotonic()
        compiler = compiler_for(stale)
        sys.stderr.write(f"core: compiling {', '.join(stale)} with {compiler.name} ...\n")
        for library in build(stale, compiler, into, strict=given.strict):
            print(f"{library.name}: {library.stat().st_size / 1024:.0f} kB, after {time.monotonic() - start:.1f} s", flush=True)
    except OSError as error:
        sys.exit(f"core: cannot write {error.filename or into}: {error.strerror}")
    except BuildFailed as failure:
        sys.stderr.write(f"{failure}\n")
        sys.exit(NO_COMPILER if isinstance(failure, CompilerMissing) else 1)


def level_here() -> list[str]:
    """Return a list with the name of the highest level (set of processor features) that this processor can run, such as "x86-64-v3".

    The list is empty if the processor is too old for all levels; the library then raises CoreUnavailable when it loads its core.
    """
    return list(knowledge().possible_levels(knowledge().processor_flags())[-1:])


def build(levels: Sequence[str], compiler: Compiler, into: Path, strict: bool) -> Iterator[Path]:
    """Build the core for each of the levels, several at a time, and yield the path of each library file when it is finished.

    `levels`: names of builds, such as "x86-64-v3" (a set of processor features). `into`: folder of the library files. `strict`: whether
    warnings of the compiler are errors. Raises BuildFailed if a build fails.
    """
    into.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        made = [pool.submit(_build_one, compiler, level, into, strict) for level in levels]
        try:
            for future in concurrent.futures.as_completed(made):
                yield future.result()
        finally:
            for future in made:
                future.cancel()


def is_current(level: str, into: Path, strict: bool) -> bool:
    """Return whether the folder `into` has a library file of this level that was built from the present sources.

    `level`: name of the build, such as "x86-64-v3". `strict`: require also that it was built with warnings of the compiler as errors.
    """
    try:
        inside = knowledge().library_file(level, into).read_bytes()
    except OSError:
        return False
    found = re.search(rb"mobee sources ([0-9a-f]{16}) (strict|lenient)\0", inside)
    return found is not None and found[1].decode() == knowledge().fingerprint() and (not strict or found[2] == b"strict")


def compiler_for(levels: Sequence[str]) -> Compiler:
    """Return the compiler for builds of the core; `levels`: names of the builds to make.

    It is the one in $CXX, or else the first of g++, clang++ and the package ziglang that is installed and compiles C++20. If `levels`
    includes the build with sanitizers (run-time checks), it is g++, whose sanitizer libraries Python can load. Raises BuildFailed, or its
    subclass CompilerMissing, if there is no such compiler.
    """
    if knowledge().SANITIZED in levels:
        if sys.platform == "linux" and shutil.which("g++"):
            return Compiler(("g++",))
        raise BuildFailed("core: the sanitizers need g++ on Linux, with its libasan and libubsan")
    if asked := os.environ.get("CXX"):
        return Compiler(tuple(shlex.split(asked)))
    for name in ("g++", "clang++"):
        if shutil.which(name) and _knows_cpp20(compiler := Compiler((name,))):
            return compiler
    if importlib.util.find_spec("ziglang"):
        return Compiler((sys.executable, "-m", "ziglang"), zig=True)
    raise CompilerMissing


def zig_requirement() -> str:
    """Return the requirement for pip, "ziglang==VERSION", of the package with a compiler for systems without one.

    VERSION is the one in core/compiler.lock, which is known to work.
    """
    return re.search(r"^ziglang==[\w.]+", COMPILER_LOCK.read_text(), re.MULTILINE)[0]  # type: ignore[index]  # the lock has this line


def oldest_glibc(library: Path) -> tuple[int, int] | None:
    """Return the oldest version of the GNU C library that a library built here needs, as (major, minor), such as (2, 17).

    Returns None if this Python does not run with the GNU C library.
    """
    if platform.libc_ver()[0] != "glibc":
        return None
    named = re.findall(rb"\0GLIBC_(\d+)\.(\d+)(?:\.\d+)?(?=\0)", library.read_bytes())
    return max([OLDEST_GLIBC, *((int(major), int(minor)) for major, minor in named)])


def knowledge() -> ModuleType:
    """Load the file mobee/_core/levels.py as a module and return it; it has the names and paths of the builds of the core.

    The package `mobee` is not imported, because its dependencies may not be installed yet when the core is built.
    """
    name = "mobee_core_levels"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, HERE.parent / "mobee" / "_core" / "levels.py")
        assert spec is not None and spec.loader is not None
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


def _build_one(compiler: Compiler, level: str, into: Path, strict: bool) -> Path:
    """Compile all sources as one and link them; the library is replaced at once, so that a process sees the old one or the new."""
    library: Path = knowledge().library_file(level, into)
    with tempfile.TemporaryDirectory(prefix=".build-", dir=into) as scratch:
        whole, made = Path(scratch) / "core.cpp", Path(scratch) / library.name
        whole.write_text("".join(f'#include "{source.relative_to(HERE).as_posix()}"\n' for source in sorted(HERE.rglob("*.cpp"))))
        extra = [f"-I{HERE}", *_processor(level, compiler.zig)]
        extra.append(f'-DMOBEE_SOURCES="{knowledge().fingerprint()} {"strict" if strict else "lenient"}"')
        if level == knowledge().SANITIZED:
            extra += SANITIZE
        elif strict:
            extra.append("-Werror")
        make = _with_zig if compiler.zig else _with_system
        make(compiler, [*FLAGS, *extra], whole, made)
        made.replace(library)
    return library


def _processor(level: str, zig: bool) -> list[str]:
    """The flags that let the compiler use all instructions of a level."""
    if level == knowledge().SANITIZED:
        level = knowledge().machine_levels()[0]
    if level == knowledge().GENERIC:
        return []
    return [f"-mcpu={level.replace('-', '_')}"] if zig else [f"-march={level}"]


def _with_system(compiler: Compiler, flags: list[str], source: Path, library: Path) -> None:
    """Compile, then link.  The compiler's own libraries are named by its driver; --as-needed drops those of which nothing is used.

    The sanitizers' are left out: they come with the process, see sanitize.py.
    """
    linked, compiled = (
        [f"-mmacosx-version-min={macos_version()}"] if sys.platform == "darwin" else ["-Wl,--as-needed"],
        source.with_suffix(".o"),
    )
    _run([*compiler.command, *flags, "-c", str(source), "-o", str(compiled)], compiler)
    _run([*compiler.command, "-shared", "-pthread", str(compiled), *linked, "-o", str(library), "-lm"], compiler)


def _with_zig(compiler: Compiler, flags: list[str], source: Path, library: Path) -> None:
    """Compile, then link with neither runtime nor C library: zig would build both from source, which takes minutes.

    What stays undefined is found when the library is loaded, in the C library of the process.  So that it is surely there, the
    library names those it needs, as their empty stand-ins do.
    """
    scratch, machine = source.parent, platform.machine()
    system = {"darwin": ["-Wl,-undefined,dynamic_lookup"], "linux": []}.get(sys.platform, [])
    target, needed, as_named = [], [], []
    if sys.platform == "darwin":
        target = ["-target", f"{machine.replace('arm64', 'aarch64')}-macos.{macos_version()}"]
    elif platform.libc_ver()[0] == "glibc":
        target = ["-target", f"{machine}-linux-gnu.{'.'.join(map(str, OLDEST_GLIBC))}"]
        needed, as_named = ["libm.so.6", "libpthread.so.0", "libc.so.6"], ["-Wl,--no-as-needed"]
    environment = {**os.environ, "ZIG_LOCAL_CACHE_DIR": str(scratch / "zig"), "ZIG_GLOBAL_CACHE_DIR": str(scratch / "zig")}
    compiled, nothing = scratch / "core.o", scratch / "nothing.c"
    outline = ["-mno-outline-atomics"] if machine in ("aarch64", "arm64") else []  # they call a runtime
    _run([*compiler.command, "c++", *target, *flags, *outline, "-c", str(source), "-o", str(compiled)], compiler, environment)
    link = [*compiler.command, "cc", *target, "-shared", "-nostdlib", *system]
    nothing.write_text("")
    stand_ins = [scratch / name for name in needed]
    for stand_in in stand_ins:
        _run([*link, f"-Wl,-soname,{stand_in.name}", str(nothing), "-o", str(stand_in)], compiler, environment)
    _run([*link, "-s", *as_named, str(compiled), *map(str, stand_ins), "-o", str(library)], compiler, environment)


def macos_version() -> str:
    """Return the oldest version of macOS on which a build runs, such as "11.0"; the variable MACOSX_DEPLOYMENT_TARGET may set it."""
    return os.environ.get("MACOSX_DEPLOYMENT_TARGET") or ("11.0" if platform.machine() == "arm64" else "10.15")


def _knows_cpp20(compiler: Compiler) -> bool:
    """Whether a compiler takes C++20 and the flags of this machine's highest level: versions do not tell of headers that are missing."""
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "probe.cpp"
        source.write_text(PROBE)
        flags = ["-std=c++20", "-shared", "-fPIC", *_processor(knowledge().machine_levels()[-1], compiler.zig)]
        command = [*compiler.command, *flags, str(source), "-o", str(source.with_suffix(".so")), "-lm"]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0


def _run(command: list[str], compiler: Compiler, environment: dict[str, str] | None = None) -> None:
    try:
        done = subprocess.run(command, env=environment, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    except OSError as error:
        raise BuildFailed(f"core: {compiler.name} could not be started: {error.strerror}") from None
    if done.returncode != 0:
        raise BuildFailed(f"{done.stdout}core: {compiler.name} could not compile the core, see above: {shlex.join(command)}")


if __name__ == "__main__":
    main()
