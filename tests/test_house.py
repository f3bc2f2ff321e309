"""The repository itself: what is committed, how it starts, what importing it does."""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HEAVY = {"zenoh", "rerun", "pybullet", "cv2", "services", "bus_schema"}


def tracked_files() -> list[Path]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    return [path for name in listing.split("\0") if name and (path := ROOT / name).is_file()]


def requirements() -> list[str]:
    text = (ROOT / "requirements.lock").read_text().replace("\\\n", " ")
    return [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]


def test_every_locked_requirement_is_pinned_and_hashed() -> None:
    locked = requirements()
    assert len(locked) > 20
    assert [line for line in locked if not re.match(r"[a-z0-9.-]+==\S+ .*--hash=sha256:[0-9a-f]{64}", line)] == []


def test_lock_names_no_index() -> None:
    assert re.findall(r"https?://|file:|--index|--extra-index|--find-links|--trusted", (ROOT / "requirements.lock").read_text()) == []


def test_lock_holds_every_declared_dependency() -> None:
    groups = [PROJECT["dependencies"], *PROJECT["optional-dependencies"].values()]
    declared = {re.match(r"[\w.-]+", line)[0] for group in groups for line in group}
    assert declared <= {line.split("==")[0] for line in requirements()}


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
    for name in ("scripts/environment.sh", "requirements.lock", "pyproject.toml"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    return tmp_path


def ensure(clone: Path) -> subprocess.CompletedProcess[str]:
    command = f"source {clone}/scripts/environment.sh; ensure_environment"
    return subprocess.run(["bash", "-euc", command, "launch"], env={"PATH": f"{clone}/bin:/usr/bin:/bin"}, capture_output=True, text=True)


def test_an_old_python_is_refused_in_one_line(bare_clone: Path) -> None:
    for name in ("python3.11", "python3", "python3.12", "python3.13", "python3.14"):
        fake_python(bare_clone / "bin", name, '[[ "$1" == --version ]] && echo "Python 3.9.18" && exit 0; exit 1')
    done = ensure(bare_clone)
    assert done.returncode != 0
    assert done.stderr.splitlines() == ["launch: needs Python 3.11 or newer, found Python 3.9.18: install python3.11 with its venv module."]


def test_a_newer_python_says_in_one_line_what_is_lost(bare_clone: Path) -> None:
    fake_python(bare_clone / "bin", "python3.11", "exit 127")
    fake_python(bare_clone / "bin", "python3", '[[ "$1" == - ]] && echo "3.13 one two" && exit 0; [[ "$1" == -c ]]')
    done = ensure(bare_clone)
    assert "kinematic back-end only" in done.stderr.splitlines()[0]
    assert done.stderr.count("PyBullet") == 1


def fake_interpreter(clone: Path, pip: str) -> None:
    """A python3.11 whose venv holds a copy of itself and whose pip runs the command `pip`; both are logged."""
    body = f"""
case "$*" in
  "-m venv "*) mkdir -p "$3/bin"; cp "$0" "$3/bin/python"; echo venv >>{clone}/log;;
  "-m pip "*) echo pip >>{clone}/log; {pip};;
  *) exec {sys.executable} "$@";;
esac"""
    fake_python(clone / "bin", "python3.11", body)


def test_an_interrupted_installation_is_not_taken_for_a_good_one(bare_clone: Path) -> None:
    fake_interpreter(bare_clone, pip="exit 7")
    for attempt in (1, 2):
        done = ensure(bare_clone)
        assert done.returncode != 0
        assert "the installation failed" in done.stderr
        assert (bare_clone / "log").read_text() == "venv\npip\n" * attempt


def test_the_environment_is_made_once_and_again_when_the_lock_changes(bare_clone: Path) -> None:
    fake_interpreter(bare_clone, pip="exit 0")
    made = "venv\npip\npip\n"  # the requirements, then the project
    for _ in range(2):
        assert ensure(bare_clone).returncode == 0
        assert (bare_clone / "log").read_text() == made
    with (bare_clone / "requirements.lock").open("a") as lock:
        lock.write("# changed\n")
    assert ensure(bare_clone).returncode == 0
    assert (bare_clone / "log").read_text() == made * 2


def test_a_changed_pyproject_installs_the_project_alone(bare_clone: Path) -> None:
    fake_interpreter(bare_clone, pip="exit 0")
    assert ensure(bare_clone).returncode == 0
    before = (bare_clone / "log").read_text()
    with (bare_clone / "pyproject.toml").open("a") as project:
        project.write("# changed\n")
    assert ensure(bare_clone).returncode == 0
    assert (bare_clone / "log").read_text() == before + "pip\n"


def test_every_folder_with_code_is_a_package() -> None:
    """The import contracts do not look into a folder without __init__.py."""
    packages = ("mobee", "bus_schema", "services", "experiments", "mobee_cli")
    folders = {path.parent for name in packages for path in (ROOT / name).rglob("*.py")}
    assert [str(folder.relative_to(ROOT)) for folder in sorted(folders) if not (folder / "__init__.py").is_file()] == []


def test_versions_agree() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
