# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(*arguments: str, path: Path = ROOT) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(path), str(ROOT)])}
    return subprocess.run([sys.executable, "-m", "mobee_system.run", *arguments], capture_output=True, text=True, env=environment)


@pytest.mark.parametrize("name", ["nosuch", "services.nosuch", "services.model.config.nosuch", "services/model", ".model", "services", ""])
def test_what_is_no_program_is_refused_in_one_line(name: str) -> None:
    done = run(name)
    assert done.returncode == 1
    assert done.stderr == f"no module {name!r} can be run: give the name of a program of the system, such as services.model\n"


def test_a_package_that_a_program_needs_is_named(tmp_path: Path) -> None:
    package = tmp_path / "own" / "__init__.py"
    package.parent.mkdir()
    package.write_text("import nosuch_package\n")
    done = run("own.service", path=tmp_path)
    assert done.returncode == 1
    assert "No module named 'nosuch_package'" in done.stderr


def test_a_program_gets_the_other_arguments() -> None:
    done = run("services.model", "--help")
    assert (done.returncode, done.stdout.split()[:2]) == (0, ["usage:", "services.model"])
