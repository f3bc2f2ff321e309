"""scripts/environment.sh compiles the engine when it has to, and only then."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """The script and the engine's sources; the environment's Python logs what it is asked to compile, and marks it as done."""
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts" / "environment.sh", tmp_path / "scripts")
    shutil.copytree(ROOT / "mobee" / "engine", tmp_path / "mobee" / "engine", ignore=shutil.ignore_patterns("__pycache__"))
    python = tmp_path / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(
        f"""#!/bin/bash
if [[ "$*" == "-m mobee.engine" ]]; then
  echo compiled >>"{tmp_path}/log"
  folder="$({sys.executable} -I mobee/engine/cache.py)"
  mkdir -p "$folder" && touch "$folder/ready"
else
  exec {sys.executable} "$@"
fi
"""
    )
    python.chmod(0o755)
    return tmp_path


def ensure(clone: Path) -> int:
    """How often it has been compiled by now."""
    command = f"source {clone}/scripts/environment.sh; ensure_engine"
    subprocess.run(["bash", "-euc", command, "test"], env={**os.environ, "MOBEE_CACHE": str(clone / "cache")}, check=True)
    return len((clone / "log").read_text().splitlines())


def test_the_engine_is_compiled_once_and_again_after_an_edit(clone: Path) -> None:
    assert [ensure(clone), ensure(clone)] == [1, 1]
    (clone / "mobee" / "engine" / "narrow" / "gjk.py").open("a").write("# edited\n")
    assert [ensure(clone), ensure(clone)] == [2, 2]


def test_a_python_that_fails_is_not_taken_for_a_compiled_engine(clone: Path) -> None:
    (clone / ".venv" / "bin" / "python").write_text("#!/bin/bash\nexit 3\n")
    with pytest.raises(subprocess.CalledProcessError):
        ensure(clone)
