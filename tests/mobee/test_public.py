# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import ast
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import mobee

FOREIGN = ("zenoh", "rerun", "pybullet", "cv2", "bus_schema", "services")


def test_every_public_name_exists_once_and_in_order():
    assert all(hasattr(mobee, name) for name in mobee.__all__)
    assert mobee.__all__ == sorted(set(mobee.__all__), key=lambda name: (name[0].islower(), name))


def test_importing_the_library_brings_no_bus_viewer_or_simulator():
    script = f"import sys, mobee; print([name for name in {FOREIGN!r} if name in sys.modules])"
    seen = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert seen.stdout.strip() == "[]"


def test_importing_the_library_loads_no_compiled_code():
    script = "import sys, mobee; print([name for name in ('mobee._core', 'mobee.model.engine', 'scipy') if name in sys.modules])"
    seen = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert seen.stdout.strip() == "[]"


def test_public_names_are_imported_when_they_are_first_used():
    script = "import sys, mobee; print('numpy' in sys.modules); mobee.load_robot; "
    script += "print('mobee.robot.load' in sys.modules, 'mobee.model.model' in sys.modules)"
    seen = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert seen.stdout.split() == ["False", "True", "False"]


def test_type_checkers_and_the_interpreter_see_the_same_names():
    source = ast.parse(Path(mobee.__file__).read_text())
    block = next(node for node in source.body if isinstance(node, ast.If))
    typed = {name.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for name in node.names}
    assert typed == {name: module for module, names in mobee._MODULES.items() for name in names.split()}
    assert sorted(typed) == sorted(mobee.__all__)


def test_a_name_that_is_not_public_is_refused():
    with pytest.raises(AttributeError, match="module 'mobee' has no attribute 'Modle'"):
        _ = mobee.Modle


def test_the_library_gives_its_version() -> None:
    assert mobee.__version__ == metadata.version("mobee")
