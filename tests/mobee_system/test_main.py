# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_command_finds_modules_of_the_user_in_the_working_directory(tmp_path: Path) -> None:
    (tmp_path / "my_forces.py").touch()
    (tmp_path / "json.py").write_text("raise ImportError('hidden')")
    command = tmp_path / "bin" / "mobee"  # as pip makes it: Python does not search the working directory for its imports
    command.parent.mkdir()
    command.write_text("import sys\nfrom mobee_system import main\nsys.exit(main())\n")
    asked = [sys.executable, str(command), "launch", "kinematic", "--set", 'shared.terms=["my_forces:nothing"]']
    done = subprocess.run(asked, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
    assert done.returncode == 2
    assert "module 'my_forces' has no attribute 'nothing'" in done.stderr
