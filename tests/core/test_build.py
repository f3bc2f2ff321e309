# SPDX-License-Identifier: Apache-2.0
"""core/build.py: the compiler that it chooses, when it need not build, and its errors."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mobee._core import library
from mobee._core.levels import machine_levels

ROOT = Path(__file__).parents[2]
COMPILER = shutil.which("g++")
ONE = ("--only", machine_levels()[0])
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no g++")

# A package that is called as ziglang is, and compiles with g++.
ZIG = f"""
import pathlib, subprocess, sys
words = sys.argv[1:]
pathlib.Path(__file__).with_name("calls").open("a").write(" ".join(words) + "\\n")
assert words[0] in ("c++", "cc")
kept = [word.replace("-mcpu=x86_64_v", "-march=x86-64-v") for word in words[1:]]
if "-target" in kept:
    at = kept.index("-target")
    del kept[at : at + 2]
sys.exit(subprocess.run(["{COMPILER}", *kept], env={{"PATH": "{os.defpath}"}}).returncode)
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A checkout whose core has one function."""
    (tmp_path / "core").mkdir()
    (tmp_path / "mobee" / "_core").mkdir(parents=True)
    (tmp_path / "bin").mkdir()
    for name in ("core/build.py", "core/compiler.lock", "core/interface.hpp", "core/interface.cpp", "mobee/_core/levels.py"):
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def build(tree: Path, *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
    given = {"PATH": os.environ["PATH"], "HOME": str(tree), **environment}
    return subprocess.run([sys.executable, "core/build.py", *options], cwd=tree, env=given, capture_output=True, text=True)


def libraries(tree: Path) -> list[Path]:
    return sorted(path for path in (tree / "mobee" / "_core").iterdir() if path.name not in ("levels.py", "__pycache__"))


def exported(library: Path) -> str:
    program = (
        "import ctypes, sys; core = ctypes.CDLL(sys.argv[1]); core.mobee_sources.restype = ctypes.c_char_p; print(core.mobee_sources())"
    )
    return subprocess.run([sys.executable, "-c", program, str(library)], capture_output=True, check=True, text=True).stdout


def test_all_levels_are_built_once_and_again_after_an_edit(tree: Path) -> None:
    assert build(tree, "--check").returncode == 1
    assert build(tree).returncode == 0
    made = {path: path.stat().st_mtime_ns for path in libraries(tree)}
    assert len(made) == len({exported(path) for path in made}) * len(made) > 0
    again = build(tree)
    assert (again.returncode, again.stdout, again.stderr) == (0, "", "")
    assert {path: path.stat().st_mtime_ns for path in libraries(tree)} == made
    assert build(tree, "--check").returncode == 0
    (tree / "core" / "more.cpp").write_text('#include "interface.hpp"\nMOBEE_CALL int mobee_more() { return 3; }\n')
    assert build(tree, "--check").returncode == 1
    assert build(tree).returncode == 0
    assert all(path.stat().st_mtime_ns > time for path, time in made.items())


def test_a_compilation_error_shows_the_compiler_s_message_and_changes_nothing(tree: Path) -> None:
    build(tree, *ONE)
    before = {path: path.read_bytes() for path in libraries(tree)}
    (tree / "core" / "wrong.cpp").write_text("int mobee_wrong = ;\n")
    done = build(tree, *ONE)
    assert done.returncode == 1
    assert done.stderr.count("wrong.cpp:1:19: error: ") == 1
    assert done.stderr.splitlines()[-1].startswith("core: g++ could not compile the core, see above: g++ -std=c++20")
    assert {path: path.read_bytes() for path in libraries(tree)} == before


def test_compiler_warnings_are_errors_by_default(tree: Path) -> None:
    (tree / "core" / "loose.cpp").write_text('#include "interface.hpp"\nMOBEE_CALL int mobee_loose(int unused) { return 1; }\n')
    assert "unused" in build(tree, *ONE).stderr
    assert libraries(tree) == []
    assert build(tree, *ONE, "--no-strict").returncode == 0
    assert build(tree, *ONE, "--no-strict", "--check").returncode == 0
    assert build(tree, *ONE, "--check").returncode == 1  # nobody has seen it compile without warnings


def test_without_a_compiler_one_line_names_the_remedies(tree: Path) -> None:
    done = build(tree, PATH=str(tree / "bin"))
    assert done.returncode == 3
    (line,) = done.stderr.splitlines()
    assert re.search(r"needs a compiler of C\+\+20 .*apt install g\+\+.*pip install ziglang==\d", line)


def test_a_compiler_without_cpp20_is_skipped(tree: Path) -> None:
    old = tree / "bin" / "g++"
    old.write_text("#!/bin/sh\nexit 1\n")
    old.chmod(0o755)
    assert build(tree, PATH=str(tree / "bin")).returncode == 3


def test_the_requested_compiler_is_used(tree: Path) -> None:
    done = build(tree, *ONE, CXX="no-such-compiler -O1")
    assert (done.returncode, done.stderr.splitlines()[-1]) == (1, "core: no-such-compiler could not be started: No such file or directory")


def test_zig_compiles_where_the_system_does_not(tree: Path) -> None:
    package = tree / "packages" / "ziglang"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(ZIG)
    done = build(tree, *ONE, PATH=str(tree / "bin"), PYTHONPATH=str(package.parent))
    assert done.returncode == 0, done.stderr
    assert "with zig" in done.stderr
    assert all("mobee sources" in exported(path) for path in libraries(tree))
    calls = (package / "calls").read_text().splitlines()
    assert all("-nostdlib" in call for call in calls if "-shared" in call)  # else zig would build its own C library


def test_a_folder_that_cannot_be_written_is_named(tree: Path) -> None:
    (tree / "file").touch()
    done = build(tree, *ONE, "--into", str(tree / "file"))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"core: cannot write {tree / 'file'}")


@pytest.mark.skipif(os.environ.get("MOBEE_CORE") == "sanitized", reason="that core holds the names of all that it could have called")
def test_the_library_needs_nothing_but_the_c_library() -> None:
    linked = Path(library()._name).read_bytes()
    assert [name for name in (b"libstdc++", b"libgcc_s", b"libc++", b"_Znw", b"__cxa_throw") if name in linked] == []


def test_a_sanitized_core_stops_at_a_wrong_address(tree: Path) -> None:
    shutil.copy(ROOT / "core" / "sanitize.py", tree / "core")
    (tree / "core" / "beyond.cpp").write_text('#include "interface.hpp"\nMOBEE_CALL double mobee_beyond(double* x) { return x[3]; }\n')
    program = (
        "import ctypes, os, sys; core = ctypes.CDLL('mobee/_core/core-sanitized.so'); core.mobee_beyond(ctypes.create_string_buffer(24))"
    )
    runner = [sys.executable, "core/sanitize.py", sys.executable, "-c"]
    fine = subprocess.run([*runner, program.replace("(24)", "(32)")], cwd=tree, capture_output=True, text=True)
    if "has no libasan" in fine.stderr:
        pytest.skip("g++ has no sanitizers")
    assert (fine.returncode, fine.stderr) == (0, "")
    wrong = subprocess.run([*runner, program], cwd=tree, capture_output=True, text=True)
    assert wrong.returncode != 0
    assert "heap-buffer-overflow" in wrong.stderr
    assert "mobee_beyond" in wrong.stderr
