# SPDX-License-Identifier: Apache-2.0
"""The repository itself: what is committed, how it starts, what importing it does."""

from __future__ import annotations

import importlib
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RUN_EXTRAS = ("live", "sim", "viz")
HEAVY = {"zenoh", "rerun", "pybullet", "cv2", "services", "bus_schema"}


def tracked_files() -> list[Path]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    return [path for name in listing.split("\0") if name and (path := ROOT / name).is_file()]


LOCKS = ("requirements.lock", "requirements-dev.lock", "core/compiler.lock")


def locked(lock: str) -> list[str]:
    text = (ROOT / lock).read_text().replace("\\\n", " ")
    return [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]


def names(requirements: list[str]) -> set[str]:
    """Of those for Python 3.11, under which the locks are written."""
    read = [Requirement(line.partition(" --hash")[0]) for line in requirements]
    return {one.name for one in read if one.marker is None or one.marker.evaluate({"python_version": "3.11"})}


@pytest.mark.parametrize("lock", LOCKS)
def test_every_locked_requirement_is_pinned_and_hashed(lock: str) -> None:
    assert [line for line in locked(lock) if not re.match(r"[a-z0-9.-]+==\S+ .*--hash=sha256:[0-9a-f]{64}", line)] == []


@pytest.mark.parametrize("lock", LOCKS)
def test_lock_names_no_index(lock: str) -> None:
    assert re.findall(r"https?://|file:|--index|--extra-index|--find-links|--trusted", (ROOT / lock).read_text()) == []


def test_the_locks_contain_all_declared_packages() -> None:
    extras = PROJECT["optional-dependencies"]
    run = names([*PROJECT["dependencies"], *(line for extra in RUN_EXTRAS for line in extras[extra])])
    assert run <= names(locked("requirements.lock"))
    assert run | names([line for lines in extras.values() for line in lines]) <= names(locked("requirements-dev.lock"))


def test_the_running_packages_are_tested_in_the_same_versions() -> None:
    assert {line.split()[0] for line in locked("requirements.lock")} <= {line.split()[0] for line in locked("requirements-dev.lock")}


def test_only_packages_of_the_running_system_are_installed_to_run() -> None:
    extras = {name: names(lines) for name, lines in PROJECT["optional-dependencies"].items()}
    others = set().union(*(extras[name] for name in extras if name not in RUN_EXTRAS)) - set().union(*(extras[name] for name in RUN_EXTRAS))
    needed_by_others = {"psutil", "pyarrow"}  # of rerun-sdk
    assert names(locked("requirements.lock")) & others <= needed_by_others


def test_no_tracked_file_names_a_machine_or_a_registry() -> None:
    home = r"(?<![\w.~-])/(?:work|root|home|Users)/[\w.]"
    registry = r"pypi\.org|pythonhosted\.org|anaconda\.org|npmjs\.(?:org|com)|crates\.io"
    pattern = re.compile(f"{home}|{registry}".encode())
    found = {path.name: match[0] for path in tracked_files() if path != Path(__file__) and (match := pattern.search(path.read_bytes()))}
    assert found == {}


def test_no_recording_or_large_file_is_tracked() -> None:
    assert [path.name for path in tracked_files() if path.suffix in {".rrd", ".sqlite"} or path.stat().st_size > 2_000_000] == []


def modules_loaded_by(code: str) -> set[str]:
    program = f"{code}\nimport json, sys\nprint(json.dumps(sorted({{name.split('.')[0] for name in sys.modules}})))"
    return set(json.loads(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, text=True).stdout))


def test_the_whole_library_loads_no_bus_viewer_or_simulator() -> None:
    loaded = modules_loaded_by("import mobee\nfor name in mobee.__all__: getattr(mobee, name)")
    assert "mobee" in loaded
    assert loaded & HEAVY == set()


def test_the_bus_contract_loads_no_bus_and_no_library() -> None:
    assert modules_loaded_by("import bus_schema.messages, bus_schema.codec") & {"zenoh", "mobee", "services"} == set()


def test_every_public_name_exists() -> None:
    mobee = importlib.import_module("mobee")
    assert mobee.__all__
    assert [name for name in mobee.__all__ if not hasattr(mobee, name)] == []


@pytest.mark.parametrize("script", ["launch", "test", ".ci/run", "scripts/environment.sh"])
def test_scripts_parse(script: str) -> None:
    subprocess.run(["bash", "-n", script], cwd=ROOT, check=True)


@pytest.mark.parametrize("script", ["launch", "test", ".ci/run"])
def test_scripts_are_committed_as_executable(script: str) -> None:
    entry = subprocess.run(["git", "ls-files", "--stage", script], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    assert entry.startswith("100755 ")


def test_help_of_the_test_script_prints_usage() -> None:
    done = subprocess.run(["./test", "--help"], cwd=ROOT, capture_output=True, check=True, text=True)
    assert done.stdout.startswith("usage: ./test [--quick]")


def fake_python(folder: Path, name: str, body: str) -> None:
    path = folder / name
    path.write_text(f"#!/bin/bash\n{body}\n")
    path.chmod(0o755)


@pytest.fixture
def bare_clone(tmp_path: Path) -> Path:
    """The scripts alone, with an empty bin/ that comes first on the path of `ensure`."""
    for folder in ("bin", "scripts"):
        (tmp_path / folder).mkdir()
    for name in ("scripts/environment.sh", "requirements.lock", "requirements-dev.lock", "pyproject.toml"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    return tmp_path


def ensure(clone: Path, *kind: str) -> subprocess.CompletedProcess[str]:
    command = f"source {clone}/scripts/environment.sh; ensure_environment {' '.join(kind)}"
    return subprocess.run(["bash", "-euc", command, "launch"], env={"PATH": f"{clone}/bin:/usr/bin:/bin"}, capture_output=True, text=True)


def test_an_old_python_is_refused_in_one_line(bare_clone: Path) -> None:
    for name in ("python3.11", "python3", "python3.12", "python3.13", "python3.14"):
        fake_python(bare_clone / "bin", name, '[[ "$1" == --version ]] && echo "Python 3.9.18" && exit 0; exit 1')
    done = ensure(bare_clone)
    assert done.returncode != 0
    assert done.stderr.splitlines() == ["launch: needs Python 3.11 to 3.14, found Python 3.9.18: install one of them with its venv module."]


def fake_interpreter(clone: Path, pip: str = "exit 0", core: str = "touch $root/core; exit 0", name: str = "python3.14") -> None:
    """A Python whose venv holds a copy of itself; pip runs the command `pip`, the core is built by `core`, and all is logged."""
    body = f"""
root={clone}
case "$*" in
  "-m venv "*) mkdir -p "$3/bin"; cp "$0" "$3/bin/python"; echo venv >>$root/log;;
  *"core/build.py --check "*) [[ -e $root/core ]];;
  *core/build.py*) echo core >>$root/log; {core};;
  *scripts/trim.py) echo trim >>$root/log; echo pybullet;;
  "-m pip uninstall "*) echo "whole again: ${{@: -1}}" >>$root/log;;
  "-m pip "*) echo pip >>$root/log; {pip};;
  *) exec {sys.executable} "$@";;
esac"""
    fake_python(clone / "bin", name, body)


RUN_MADE = "venv\npip\ntrim\ncore\npip\n"  # the packages, the core, the project


def log(clone: Path) -> str:
    return (clone / "log").read_text()


def test_an_interrupted_installation_is_not_taken_for_a_good_one(bare_clone: Path) -> None:
    fake_interpreter(bare_clone, pip="echo ERROR: no space; exit 7")
    for attempt in (1, 2):
        done = ensure(bare_clone)
        assert done.returncode != 0
        assert done.stderr.splitlines()[-2:] == [
            "ERROR: no space",
            "launch: the installation failed, see above; .venv is marked unfinished and will be made anew by the next call.",
        ]
        assert log(bare_clone) == "venv\npip\n" * attempt


def test_the_environment_is_made_once_and_again_when_the_lock_changes(bare_clone: Path) -> None:
    fake_interpreter(bare_clone)
    for _ in range(2):
        assert ensure(bare_clone).returncode == 0
        assert log(bare_clone) == RUN_MADE
    with (bare_clone / "requirements.lock").open("a") as lock:
        lock.write("# changed\n")
    assert ensure(bare_clone).returncode == 0
    assert log(bare_clone) == RUN_MADE + RUN_MADE.replace("core\n", "")


def test_stages_are_announced_before_they_start_and_a_pipe_gets_no_progress(bare_clone: Path) -> None:
    fake_interpreter(bare_clone)
    reports = ensure(bare_clone).stderr.splitlines()
    assert [line[: len("launch: 1 of 3")] for line in reports[:3]] == [f"launch: {stage} of 3" for stage in (1, 2, 3)]
    assert re.search(r"1 of 3: \d+ packages into .venv, \d+ MB to download and 1 GB on disk", reports[0])
    assert len(reports) == 4
    assert "installed in" in reports[-1]


def test_the_newest_python_runs_it_and_the_tests_take_3_11(bare_clone: Path) -> None:
    for name in ("python3.11", "python3.13"):
        fake_interpreter(bare_clone, name=name)
    fake_python(bare_clone / "bin", "python3.14", "exit 127")
    for kind, name in (("dev", "python3.11"), ("run", "python3.11"), ("anew", "python3.13")):  # what ./test has made runs it, too
        if kind == "anew":
            shutil.rmtree(bare_clone / ".venv")
        assert ensure(bare_clone, "dev" if kind == "dev" else "run").returncode == 0
        assert (bare_clone / ".venv/made-with").read_text() == f"{bare_clone}/bin/{name}\n"


def test_a_changed_pyproject_installs_the_project_alone(bare_clone: Path) -> None:
    fake_interpreter(bare_clone)
    assert ensure(bare_clone).returncode == 0
    before = log(bare_clone)
    with (bare_clone / "pyproject.toml").open("a") as project:
        project.write("# changed\n")
    assert ensure(bare_clone).returncode == 0
    assert log(bare_clone) == before + "pip\n"


def test_packages_for_the_tests_are_added_to_the_running_environment(bare_clone: Path) -> None:
    fake_interpreter(bare_clone)
    assert ensure(bare_clone).returncode == 0
    before = log(bare_clone)
    for _ in range(2):
        assert ensure(bare_clone, "dev").returncode == 0
        assert log(bare_clone) == before + "whole again: pybullet\npip\n"
    assert ensure(bare_clone).returncode == 0
    assert log(bare_clone) == before + "whole again: pybullet\npip\n"  # enough to run, too


def test_after_a_change_of_the_core_only_the_core_is_built_again(bare_clone: Path) -> None:
    fake_interpreter(bare_clone)
    assert ensure(bare_clone).returncode == 0
    before = log(bare_clone)
    (bare_clone / "core").unlink()
    assert ensure(bare_clone).returncode == 0
    assert log(bare_clone) == before + "core\n"


def test_where_there_is_no_compiler_one_is_fetched_for_the_core(bare_clone: Path) -> None:
    fake_interpreter(bare_clone, core="[[ -n ${PYTHONPATH:-} ]] || exit 3; touch $root/core; exit 0")
    done = ensure(bare_clone)
    assert done.returncode == 0
    assert "fetching a compiler" in done.stderr
    assert log(bare_clone) == RUN_MADE.replace("core\n", "core\npip\ncore\n")


def test_a_core_that_does_not_compile_shows_the_compiler_s_message(bare_clone: Path) -> None:
    fake_interpreter(bare_clone, core="echo wrong.cpp: error >&2; exit 1")
    done = ensure(bare_clone)
    assert done.returncode != 0
    assert done.stderr.splitlines()[-1] == "wrong.cpp: error"


def test_every_folder_with_code_is_a_package() -> None:
    """The import contracts do not look into a folder without __init__.py."""
    packages = ("mobee", "bus_schema", "services", "experiments", "mobee_cli")
    folders = {path.parent for name in packages for path in (ROOT / name).rglob("*.py")}
    assert [str(folder.relative_to(ROOT)) for folder in sorted(folders) if not (folder / "__init__.py").is_file()] == []


def test_versions_agree() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"].split(" AND ")[0]  # that of the code; the format of the citation has no AND


RETIRED = re.compile(
    r"(?<![a-z])(?:"
    r"goes[ _]without|overtures?\b|limps?\b|dawdl|for ever\b|outset\b|told_world|world_told|told_terms"
    r"|still_nears|toldcontacts|way_to_reach|state_of_part|edges_told|made_alike|dear to\b|dearer\b"
    r"|go on with --resume|take another seed|goaldesk|worlddesk|drivedesk"
    r"|ways?[ _]out\b|feels?\b|makes for\b|the lack of|sways?\b|ease[sd]?\b|as it were\b"
    r"|go(?:es)?[ _]on\b|went on\b|felt\b)"
)
"""Words that stood for: is redundant, start-up status, is degraded, inject a delay, indefinitely, search schedule, world from JSON,
published terms, is approaching, published contacts, plan a reach, state of a part's pose, expensive, continue the run, use another
seed; and since 25 November 2026 for: least separation, has a contact, builds, is missing, drift, mobility, has no, so to speak;
since 26 November 2026 for: continue or resume, detected."""

TEXTS = {".py", ".md", ".hpp", ".cpp", ".toml", ".js", ".html"}
HISTORY = {"CHANGELOG.md", "docs/decisions.md"}  # these say what was, in the words of their time


def test_words_that_were_retired_stay_away() -> None:
    used = []
    for path in tracked_files():
        if path.suffix in TEXTS and str(path.relative_to(ROOT)) not in {*HISTORY, "tests/test_house.py"}:
            used += [f"{path.relative_to(ROOT)}: {word}" for word in RETIRED.findall(path.read_text().lower())]
    assert used == []
