# SPDX-License-Identifier: Apache-2.0
"""Fuzzes the reader of URDF files: python tests/fuzz/fuzz_urdf.py -max_total_time=300."""

from __future__ import annotations

import sys
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).parents[2]))

with atheris.instrument_imports(include=["mobee.robot"]):
    from tests.fuzz.readers import feed_urdf, urdf_seeds, words

from tests.fuzz.harness import fuzz

if __name__ == "__main__":
    fuzz(feed_urdf, urdf_seeds(), words(urdf_seeds()))
