# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import subprocess
import sys

import pytest


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "mobee_system.run", *arguments], capture_output=True, text=True)


@pytest.mark.parametrize("name", ["nosuch", "services.nosuch", "services.model.config.nosuch", "services/model", ".model", "services", ""])
def test_what_is_no_program_is_refused_in_one_line(name: str) -> None:
    done = run(name)
    assert done.returncode == 1
    assert done.stderr == f"no module {name!r} can be run: give the name of a program of the system, such as services.model\n"


def test_a_program_gets_the_other_arguments() -> None:
    done = run("services.model", "--help")
    assert (done.returncode, done.stdout.split()[:2]) == (0, ["usage:", "services.model"])
