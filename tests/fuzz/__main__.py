# SPDX-License-Identifier: Apache-2.0
"""`python -m tests.fuzz READER [options of libFuzzer]`: a coverage-guided fuzzer; see README.md."""

from __future__ import annotations

import os
import sys
from functools import partial

import atheris

PACKAGES = ["mobee", "bus_schema", "services"]

with atheris.instrument_imports(include=PACKAGES):
    from tests.fuzz import files, handlers, readers
    from tests.fuzz.harness import fuzz

READERS = {  # what each is fed, its seeds, and whether they are elements and attributes
    "xml": (readers.feed_xml, readers.xml_seeds, True),
    "urdf": (readers.feed_urdf, readers.urdf_seeds, True),
    "scenario": (files.feed_scenario, files.scenario_seeds, False),
    "roadmap": (files.feed_roadmap, files.roadmap_seeds, False),
    "store": (files.feed_store, files.store_seeds, False),
    "recording": (files.feed_recording, files.recording_seeds, False),
    "message": (files.feed_message, files.message_seeds, False),
    **{who: (handlers.feeder(who), partial(handlers.seeds_of, who), False) for who in handlers.SERVICES},
}

if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in READERS:
        sys.exit(f"usage: python -m tests.fuzz {{{','.join(READERS)}}} [-max_total_time=SECONDS ...]")
    feed, seeds, is_xml = READERS[sys.argv.pop(1)]
    code: int | str | None = 1
    try:
        fuzz(feed, seeds(), readers.words(seeds()) if is_xml else [])
    except SystemExit as ended:
        code = ended.code
    finally:
        os._exit(code if isinstance(code, int) else 1)  # an open session would keep the interpreter from exiting
