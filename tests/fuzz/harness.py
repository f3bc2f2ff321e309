# SPDX-License-Identifier: Apache-2.0
"""Runs a coverage-guided fuzzer (atheris) on one reader; see README.md."""

from __future__ import annotations

import random
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import atheris

from tests.fuzz.mutations import mutated

SECONDS = 5  # an input that takes longer is a finding


def fuzz(feed: Callable[[bytes, Path], bool], seeds: list[bytes], names: list[str]) -> None:
    """Feed what libFuzzer makes of the seeds to `feed` until it raises; options of libFuzzer are read from the command line.

    `names`: elements and attributes of XML that are written into the seeds; of seeds of other kinds only bytes are changed.
    """
    with tempfile.TemporaryDirectory() as folder:
        corpus, work = Path(folder) / "corpus", Path(folder) / "work"
        corpus.mkdir()
        work.mkdir()
        for index, seed in enumerate(seeds):
            (corpus / str(index)).write_bytes(seed)

        def mutate(data: bytes, max_size: int, seed: int) -> bytes:
            rng = random.Random(seed)
            if not names or rng.random() < 0.3:
                return bytes(atheris.Mutate(data, max_size))
            return mutated(data.decode("utf-8", "surrogateescape"), rng, names).encode("utf-8", "surrogateescape")[:max_size]

        def one(data: bytes) -> None:
            feed(data, work)

        program, *given = sys.argv
        longest = max(8192, 2 * max(map(len, seeds)))
        options = [f"-timeout={SECONDS}", f"-max_len={longest}", *given, str(corpus)]
        atheris.Setup([program, *options], one, custom_mutator=mutate)
        atheris.Fuzz()
