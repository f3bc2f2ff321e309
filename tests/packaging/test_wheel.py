# SPDX-License-Identifier: Apache-2.0
"""The wheel, installed into an environment of its own: its content, and that the library and the live system work with it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = {"live", "sim", "viz", "reference", "planning", "parquet", "cluster", "figures", "fuzz", "bench", "dev", "docs", "fcl"} | {
    "film",
    "gym",
    "menagerie",
    "meshes",
    "mjcf",
    "track",
    "vision",
}


class Installed:
    """A virtual environment with MoBeE from its wheel; all other packages are those of the environment that runs the tests."""

    def __init__(self, folder: Path) -> None:
        self.wheel = self._build(folder / "dist")
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
        self.bin = folder / "venv/bin"
        self.packages = next((folder / "venv").glob("lib/python*/site-packages"))
        pip = [sys.executable, "-m", "pip", "--python", self.bin / "python", "--disable-pip-version-check", "--no-input"]
        options = ["--quiet", "--no-deps", "--no-index", "--no-compile"]  # what the tests import is compiled then, a part of all
        subprocess.run([*pip, "install", *options, self.wheel], check=True)
        # As a line of a .pth file the folder is only added to the path: an editable installation of MoBeE in it stays unseen.
        (self.packages / "others.pth").write_text(sysconfig.get_paths()["platlib"] + "\n")

    @staticmethod
    def _build(folder: Path) -> Path:
        subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder], cwd=ROOT, check=True, capture_output=True)
        (wheel,) = folder.glob("*.whl")
        return wheel

    def run(self, folder: Path, program: str, *arguments: str, path: str = "") -> subprocess.CompletedProcess[str]:
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | ({"PYTHONPATH": path} if path else {})
        return subprocess.run([self.bin / program, *arguments], cwd=folder, env=kept, capture_output=True, text=True, timeout=60)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installed]:
    yield Installed(tmp_path_factory.mktemp("installed"))


@pytest.fixture
def crowded(tmp_path: Path) -> Path:
    """A working directory with packages of its own that have the names of MoBeE's; importing one of them is an error."""
    for name in ("services", "experiments", "bus_schema", "mobee_cli"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise RuntimeError('the package of the working directory was imported')\n")
    return tmp_path


def test_the_wheel_puts_two_names_into_site_packages(installed: Installed) -> None:
    names = {name.split("/")[0] for name in zipfile.ZipFile(installed.wheel).namelist()}
    assert {name for name in names if not name.endswith(".dist-info")} == {"mobee", "mobee_system"}


def test_the_wheel_holds_every_module_and_data_file_and_no_other(installed: Installed) -> None:
    tracked = subprocess.run(
        ["git", "ls-files", "mobee*", "bus_schema", "services", "experiments"], cwd=ROOT, capture_output=True, text=True
    )
    expected = {name if name.startswith(("mobee/", "mobee_system/")) else f"mobee_system/{name}" for name in tracked.stdout.split()}
    packed = {name for name in zipfile.ZipFile(installed.wheel).namelist() if ".dist-info/" not in name}
    libraries = {name for name in packed if re.match(r"mobee/_core/core-.*\.(so|dylib)$", name)}
    assert libraries
    assert packed - libraries == expected


def test_the_wheel_names_and_holds_both_licences(installed: Installed) -> None:
    archive = zipfile.ZipFile(installed.wheel)
    (metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
    assert "License-Expression: Apache-2.0 AND CC-BY-SA-4.0" in archive.read(metadata).decode().splitlines()
    packed = {name.partition("/licenses/")[2] for name in archive.namelist()}
    assert {"LICENSES/Apache-2.0.txt", "LICENSES/CC-BY-SA-4.0.txt", "REUSE.toml"} <= packed


def test_the_library_alone_needs_three_packages() -> None:
    assert {re.match(r"[\w-]+", line)[0] for line in PROJECT["dependencies"]} == {"defusedxml", "numpy", "scipy"}
    assert set(PROJECT["optional-dependencies"]) == EXTRAS


def test_the_command_knows_its_version_and_robots(installed: Installed, crowded: Path) -> None:
    assert installed.run(crowded, "mobee", "--version").stdout == f"mobee {PROJECT['version']}\n"
    robots = installed.run(crowded, "mobee", "robots")
    assert robots.returncode == 0, robots.stderr
    assert "icub" in robots.stdout


def test_the_code_of_the_readme_runs_with_the_library_of_the_wheel(installed: Installed, crowded: Path) -> None:
    (code,) = re.findall(r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE)
    place = "\nimport pathlib\nprint(pathlib.Path(mobee.__file__).parent)"
    done = installed.run(crowded, "python", "-c", code + place)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == str(installed.packages / "mobee")


@pytest.mark.system
@pytest.mark.untimed
def test_a_system_starts_and_ends_in_a_folder_that_has_its_own_services(installed: Installed, crowded: Path, free_port: int) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    done = installed.run(crowded, "mobee", "launch", "kinematic", "--headless", "--duration", "3", "--json", "--endpoint", endpoint)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["ticks"] > 0


def test_a_script_of_the_user_finds_the_packages_of_the_bus(installed: Installed, crowded: Path) -> None:
    done = installed.run(crowded, "python", "-c", "import mobee_system\nfrom bus_schema import keys\nprint(keys.__file__)")
    assert done.stdout == f"{installed.packages}/mobee_system/bus_schema/keys.py\n", done.stderr


@pytest.mark.parametrize("verb", ["launch", "status", "topic"])
def test_without_the_live_extra_the_command_names_it(installed: Installed, crowded: Path, verb: str) -> None:
    """Packages that raise what Python raises for one that is not installed stand in for the missing ones."""
    for name in ("zenoh", "msgspec", "tyro"):
        (crowded / f"{name}.py").write_text(f"raise ModuleNotFoundError(name={name!r})\n")
    done = installed.run(crowded, "mobee", verb, path=str(crowded))
    assert done.returncode == 3
    assert re.fullmatch(rf'mobee {verb}: needs \w+, which is not installed: pip install "mobee\[live\]"\n', done.stderr)
    assert installed.run(crowded, "mobee", "robots", path=str(crowded)).returncode == 0
