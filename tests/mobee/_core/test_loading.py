# SPDX-License-Identifier: Apache-2.0
"""Which build of the core is loaded, and the error if none can be loaded."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mobee import _core
from mobee._core import CoreUnavailable, choose, levels, load
from mobee._core.levels import NEEDS, library_file, machine_levels, missing, processor_flags
from mobee.errors import MobeeError

ROOT = Path(__file__).parents[3]
X86 = pytest.mark.skipif("x86-64-v2" not in machine_levels(), reason="one build for all processors")
OF_LEVEL = {level: {flag for name in NEEDS if name <= level for flag in NEEDS[name]} for level in NEEDS}
HERE = [level for level in machine_levels() if not missing(level, processor_flags())]


def built(folder: Path, *names: str) -> Path:
    for name in names:
        library_file(name, folder).touch()
    return folder


@X86
@pytest.mark.parametrize("level", NEEDS)
def test_the_widest_level_of_a_processor_is_chosen(level: str, tmp_path: Path) -> None:
    assert choose("", OF_LEVEL[level], built(tmp_path, *NEEDS)) == level


@X86
def test_a_level_that_is_not_built_is_passed_over(tmp_path: Path) -> None:
    assert choose("", OF_LEVEL["x86-64-v4"], built(tmp_path, "x86-64-v2", "x86-64-v3")) == "x86-64-v3"


@X86
def test_a_level_can_be_asked_for() -> None:
    assert choose("x86-64-v2", OF_LEVEL["x86-64-v4"]) == "x86-64-v2"


@X86
@pytest.mark.parametrize(
    ("forced", "flags", "said"),
    [
        ("", {"sse2"}, "needs a processor of level x86-64-v2, .* lacks cx16, .*sse4_2"),
        ("x86-64-v4", OF_LEVEL["x86-64-v3"], "MOBEE_CORE=x86-64-v4: .* lacks avx512bw, .* Valid here: x86-64-v2, x86-64-v3;"),
        ("x86-64-v3", {"sse2"}, "MOBEE_CORE=x86-64-v3: .* None of the builds runs here"),
        ("x86_64_v3", OF_LEVEL["x86-64-v3"], "unknown level in MOBEE_CORE: 'x86_64_v3'. Did you mean 'x86-64-v3'"),
        ("sanitized", OF_LEVEL["x86-64-v3"], "run python core/sanitize.py"),
    ],
)
def test_a_build_that_does_not_run_here_is_refused_in_one_line(
    forced: str, flags: set[str], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("LD_PRELOAD", raising=False)
    with pytest.raises(CoreUnavailable, match=said) as caught:
        choose(forced, flags)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, MobeeError)


def test_the_flags_are_those_the_kernel_names(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(
        "processor\t: 0\nmodel name\t: Some\nflags\t\t: fpu sse2 cx16\nvmx flags\t: other\n\nprocessor\t: 1\nflags\t\t: fpu\n"
    )
    assert processor_flags(cpuinfo) == {"fpu", "sse2", "cx16"}
    assert missing("x86-64-v2", processor_flags(tmp_path / "none")) == []


def test_a_library_that_is_not_there_is_named_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(CoreUnavailable, match=r"there is no .*core-.*: run python\S* .*build.py$"):
        load(HERE[0], tmp_path)


def test_a_file_that_is_no_library_is_named_with_the_remedy(tmp_path: Path) -> None:
    library_file(HERE[0], tmp_path).write_text("no library")
    with pytest.raises(CoreUnavailable, match="cannot be loaded .*build.py$"):
        load(HERE[0], tmp_path)


def test_a_library_of_other_sources_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_core, "fingerprint", lambda: "0" * 16)
    with pytest.raises(CoreUnavailable, match="was built from other sources than those in .*build.py$"):
        load(HERE[0])


def test_an_installed_library_has_no_sources_to_agree_with(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(_core, "SOURCES", tmp_path)
    monkeypatch.setattr(_core, "fingerprint", lambda: "0" * 16)
    assert load(HERE[0])
    with pytest.raises(CoreUnavailable, match="pip install --force-reinstall"):
        load(HERE[0], tmp_path)


def test_a_library_with_another_interface_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_core, "ABI", _core.ABI + 1)
    with pytest.raises(CoreUnavailable, match=f"has the interface {_core.ABI - 1}, this version of mobee calls {_core.ABI}"):
        load(HERE[0])


def test_a_command_says_in_one_line_that_there_is_no_core() -> None:
    command = [sys.executable, "-m", "mobee_cli", "launch", "--duration", "1"]
    done = subprocess.run(command, cwd=ROOT, env={**os.environ, "MOBEE_CORE": "x86-64-v9"}, capture_output=True, text=True)
    assert done.returncode == 3
    assert done.stderr.startswith("mobee launch: unknown level in MOBEE_CORE: 'x86-64-v9'")
    assert len(done.stderr.splitlines()) == 1


def test_nothing_is_loaded_before_it_is_needed() -> None:
    program = "import mobee._core, ctypes; assert mobee._core.library.cache_info().currsize == 0"
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, env={**os.environ, "MOBEE_CORE": "none"}, check=True)


def test_all_levels_of_this_machine_give_the_same_bits() -> None:
    command = [sys.executable, "-m", "tests.mobee._core.everything"]
    running = [
        subprocess.Popen(command, cwd=ROOT, env={**os.environ, "MOBEE_CORE": level}, stdout=subprocess.PIPE, text=True) for level in HERE
    ]
    answers = [json.loads(process.communicate()[0]) for process in running]
    assert all(process.returncode == 0 for process in running)
    for level, answer in zip(HERE, answers, strict=True):
        assert answer == answers[0], level


def test_every_level_is_built() -> None:
    assert [level for level in machine_levels() if not library_file(level).exists()] == []
    assert levels.fingerprint() in _core.library().mobee_sources().decode()
