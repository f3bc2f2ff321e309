# SPDX-License-Identifier: Apache-2.0
"""Remove from an installed PyBullet what no part of the system uses: 290 of its 300 MB.

    python scripts/trim.py

Its wheel holds the robots and environments of its examples, and an extension module whose debug information is sixteen times as large
as its code.  ./test reads those robots and installs the whole package again.  Prints the names of the packages that it changed.
"""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
import sysconfig
from pathlib import Path

PACKAGE = "pybullet"
UNUSED = ("pybullet_data", "pybullet_envs", "pybullet_examples", "pybullet_robots", "eglRenderer.*.so")
IMPORT = f"import {PACKAGE}; {PACKAGE}.connect({PACKAGE}.DIRECT)"


def main() -> None:
    """Remove unused files and debug information of PyBullet from the packages of this Python, and print the package's name.

    Without an installed PyBullet wheel nothing is changed or printed.
    """
    packages = Path(sysconfig.get_paths()["platlib"])
    programs = list(packages.glob(f"{PACKAGE}.*.so"))
    if not programs:  # no wheel for this Python
        return
    for pattern in UNUSED:
        for path in packages.glob(pattern):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    for program in programs:
        drop_debug_information(program)
    print(PACKAGE)


def drop_debug_information(program: Path) -> None:
    """Cut an ELF file after its last segment; leave it unchanged if it is of another kind, or cannot be imported afterwards."""
    data = program.read_bytes()
    loaded = end_of_segments(data)
    if loaded is None or loaded >= len(data):
        return
    short = bytearray(data[:loaded])
    struct.pack_into("<Q", short, 40, 0)  # offset of the section table: none
    struct.pack_into("<HHH", short, 58, 0, 0, 0)  # size of its entries, their number, index of their names
    program.write_bytes(short)
    if subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, check=False).returncode != 0:
        program.write_bytes(data)


def end_of_segments(data: bytes) -> int | None:
    """Return the number of bytes in an ELF file (program or library) up to the end of its last segment; None: no little-endian 64-bit ELF.

    The program is loaded from the segments alone. The bytes after them are section tables and debug information. `data`: the whole file.
    """
    if data[:6] != b"\x7fELF\x02\x01":
        return None
    table, (size, number) = struct.unpack_from("<Q", data, 32)[0], struct.unpack_from("<HH", data, 54)
    segments = [struct.unpack_from("<QQQQ", data, table + i * size + 8) for i in range(number)]  # offset, two addresses, length
    return max(offset + length for offset, _, _, length in segments)


if __name__ == "__main__":
    main()
