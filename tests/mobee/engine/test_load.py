"""Loading, in processes of their own: the engine is a stand-in that compiles in a second, but where it says otherwise."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mobee.engine.load import load

ROOT = Path(__file__).parents[3]

STAND_IN = """
import os, pathlib, time
from mobee.engine.compiled import entry, inner

@inner
def half(x):
    return 0.5 * x

@entry("float64(float64)")
def twice(x):
    return 4.0 * half(x)

time.sleep(float(os.environ.get("NAP", "0")))
"""

USE = """
import sys
sys.path.insert(0, {folder!r})
import mobee.engine.load
from numba.core import event
mobee.engine.load.MODULES = mobee.engine.load.ENGINE = ("stand_in",)
with event.install_recorder("numba:compile") as recorder:
    mobee.engine.load.load()
import stand_in
print(stand_in.twice(21.0), sum(each.is_end for _, each in recorder.buffer))
"""


class Start:
    """A process that loads the stand-in with its cache in a folder; `code` runs first."""

    def __init__(self, folder: Path, cache: Path | None = None, code: str = "", source: str = STAND_IN, **environment: str) -> None:
        (folder / "stand_in.py").write_text(source)
        settings = {**os.environ, "MOBEE_CACHE": str(cache or folder / "cache"), **environment}
        self.process = subprocess.Popen(
            [sys.executable, "-c", code + USE.format(folder=str(folder))],
            cwd=ROOT,
            env=settings,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def end(self) -> tuple[int, str]:
        """How many functions were compiled, and what was said; what is compiled works in any case."""
        out, said = self.process.communicate(timeout=120)
        assert self.process.returncode == 0, said
        result, compiled = out.split()
        assert result == "42.0"
        return int(compiled), said


def code_files(folder: Path) -> list[Path]:
    return [file for file in (folder / "cache").rglob("*-*") if file.is_file()]


def test_the_first_start_compiles_and_says_so_the_next_does_neither(tmp_path: Path) -> None:
    compiled, said = Start(tmp_path).end()
    assert compiled == 2
    lines = said.splitlines()
    assert lines[0].startswith(f"mobee: compiling the engine into {tmp_path}/cache/engine-")
    assert lines[-1].startswith("mobee: the engine is compiled")
    assert Start(tmp_path).end() == (0, "")


def test_an_edit_of_a_file_elsewhere_compiles_what_is_in_it_anew(tmp_path: Path) -> None:
    Start(tmp_path, source=STAND_IN.replace("0.5 * x", "0.25 * x").replace("4.0 *", "8.0 *")).end()
    assert Start(tmp_path).end()[0] == 2
    assert Start(tmp_path).end()[0] == 0


def test_another_version_takes_over_what_has_not_changed(tmp_path: Path) -> None:
    Start(tmp_path).end()
    [folder] = (tmp_path / "cache").glob("engine-*")
    folder.rename(folder.with_name(f"engine-{0:016x}"))
    assert Start(tmp_path).end() == (0, "")
    assert len(code_files(tmp_path)) == 3  # not `half`: it is part of `twice`


def test_of_two_starts_at_once_one_compiles_and_the_other_waits_for_it(tmp_path: Path) -> None:
    one, two = Start(tmp_path, NAP="3"), Start(tmp_path, NAP="3")
    results = sorted((one.end(), two.end()))
    assert [compiled for compiled, _ in results] == [0, 2]
    assert "waiting for it" in results[0][1]
    assert "compiling the engine" not in results[0][1]


def test_nobody_waits_for_a_process_that_was_killed_while_it_compiled(tmp_path: Path) -> None:
    killed = Start(tmp_path, NAP="60")
    deadline = time.monotonic() + 60
    while len(code_files(tmp_path)) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    killed.process.kill()
    killed.process.communicate()
    compiled, said = Start(tmp_path).end()
    assert (compiled, said) == (0, "")  # all was written, and is looked for though nobody said that it was complete
    assert len(list((tmp_path / "cache").rglob("ready"))) == 1


@pytest.mark.parametrize("damage", ["cut", "changed"])
def test_damaged_files_are_compiled_anew(tmp_path: Path, damage: str) -> None:
    Start(tmp_path).end()
    files = code_files(tmp_path)
    assert len(files) == 2
    for file in files:
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 0xFF
        file.write_bytes(content[: len(content) // 2] if damage == "cut" else content)
    compiled, said = Start(tmp_path).end()
    assert compiled == 2
    assert "compiling the engine" in said
    assert Start(tmp_path).end() == (0, "")


def test_where_nothing_can_be_written_the_engine_works_and_a_remedy_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    compiled, said = Start(tmp_path, cache=tmp_path / "file" / "below").end()
    assert compiled == 2
    assert "compiled in memory" in said
    assert "MOBEE_CACHE" in said


def test_a_full_disk_is_said_and_not_taken_for_a_complete_cache(tmp_path: Path) -> None:
    full = "import errno, os\ndef full(*_):\n    raise OSError(errno.ENOSPC, 'No space left on device')\nos.replace = full\n"
    compiled, said = Start(tmp_path, code=full).end()
    assert compiled == 2
    assert "No space left on device" in said
    assert code_files(tmp_path) == []
    assert Start(tmp_path).end()[0] == 2


def test_sources_edited_while_they_compile_are_not_marked_as_done(tmp_path: Path) -> None:
    edited = "import mobee.engine.load, pathlib\nmobee.engine.load.cache_folder = lambda: pathlib.Path('another')\n"
    Start(tmp_path, code=edited).end()
    assert list((tmp_path / "cache").rglob("ready")) == []


def test_settings_of_numba_stay_as_the_user_made_them(tmp_path: Path) -> None:
    check = "import atexit, numba\natexit.register(lambda: numba.config.CACHE_DIR == 'mine' or os._exit(1))\nimport os\n"
    Start(tmp_path, code=check, NUMBA_CACHE_DIR="mine").end()


def test_with_the_compiler_switched_off_it_is_python(tmp_path: Path) -> None:
    assert Start(tmp_path, NUMBA_DISABLE_JIT="1").end() == (0, "")


WARM = """
import time
begin = time.perf_counter()
import mobee
robot = mobee.load_robot("icub")
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    model = mobee.Model(robot)
    pose = model.evaluate(robot.home)
    pose.contacts, pose.transforms, pose.projection, pose.projection_of_part, model.jacobian(robot.home, next(iter(robot.markers)))
print(len(recorder.buffer), f"first pose after {time.perf_counter() - begin:.2f} s")
"""


def test_a_warm_start_compiles_nothing() -> None:
    """Of the engine itself."""
    load()
    done = subprocess.run([sys.executable, "-c", WARM], cwd=ROOT, capture_output=True, text=True, check=True)
    compiled, _, time_to_first_pose = done.stdout.partition(" ")
    print(time_to_first_pose)
    assert compiled == "0"
    assert done.stderr == ""


ONE = """
import sys
from mobee.engine.load import load_only
print(load_only("mobee.engine.descent").__name__, "mobee.engine.evaluate" in sys.modules)
"""

ONE_OF_TWO = """
import sys
sys.path.insert(0, {folder!r})
import mobee.engine.load
mobee.engine.load.MODULES = ("stand_in", "another")
print(mobee.engine.load.load_only("stand_in").twice(21.0), "another" in sys.modules)
"""


def test_who_needs_one_module_loads_no_other() -> None:
    load()
    done = subprocess.run([sys.executable, "-c", ONE], cwd=ROOT, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("mobee.engine.descent False\n", "")


def test_who_needs_one_module_and_finds_nothing_compiled_compiles_all(tmp_path: Path) -> None:
    for name in ("stand_in", "another"):
        (tmp_path / f"{name}.py").write_text(STAND_IN)
    command = [sys.executable, "-c", ONE_OF_TWO.format(folder=str(tmp_path))]
    for printed in ("42.0 True\n", "42.0 False\n"):
        environment = {**os.environ, "MOBEE_CACHE": str(tmp_path / "cache")}
        assert subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True).stdout == printed
