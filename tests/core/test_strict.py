# SPDX-License-Identifier: Apache-2.0
"""No build joins a multiplication to an addition: that rounds once instead of twice, and older processors cannot."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from mobee._core.levels import FOLDER, library_file, machine_levels


@pytest.mark.parametrize("level", machine_levels())
def test_there_is_no_fused_instruction(level: str) -> None:
    library, objdump = library_file(level, FOLDER), shutil.which("objdump")
    if objdump is None or not library.exists():
        pytest.skip("needs objdump, and the build")
    listing = subprocess.run([objdump, "-d", "--no-show-raw-insn", str(library)], capture_output=True, text=True, check=True).stdout
    # g++ 12 makes some of sums and differences side by side, in spite of -ffp-contract=off.
    assert not set(re.findall(r"\bvfn?m(?:add|sub)\w*", listing))
