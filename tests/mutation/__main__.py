# SPDX-License-Identifier: Apache-2.0
"""`python -m tests.mutation [FILE ...]`: the share of small changes of the sources that the tests notice.

Each mutant is run against the tests of its file in a copy of the project.  A mutant that no test notices has survived: either a test is
absent, or the change makes no difference (an equivalent mutant; these are counted too).
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tests.mutation.mutants import Mutant, mutants
from tests.mutation.running import ROOT, copy_of_project, is_noticed

SIM, CONTROLLER = "tests/services/robot_sim", "tests/services/controller"

SAFETY = {  # between a command and a motor: all mutants
    "services/robot_sim/gate.py": (f"{SIM}/test_gate.py", f"{SIM}/test_admission.py"),
    "services/robot_sim/guard.py": (
        f"{SIM}/test_guard.py",
        f"{SIM}/test_process_admission.py",
        f"{SIM}/test_process_modes.py",
        f"{SIM}/test_process_streams.py",
        f"{SIM}/test_process_settings.py",
        f"{SIM}/test_lockstep.py",
    ),
    "mobee/simulation/motors.py": (
        "tests/mobee/simulation",
        "tests/mobee/reference",
        "tests/mobee/control/test_slides.py",
        f"{SIM}/test_gate.py",
    ),
}
OTHERS = {  # of these a sample
    "mobee/control/law.py": ("tests/mobee/control", "tests/mobee/reference"),
    "mobee/control/reach.py": ("tests/mobee/control",),
    "mobee/control/reach_forces.py": ("tests/mobee/control",),
    "mobee/learning/planner.py": ("tests/mobee/learning",),
    "mobee/learning/transitions.py": ("tests/mobee/learning",),
    "mobee/roadmap/evolution/nes.py": ("tests/mobee/roadmap/evolution",),
    "mobee/roadmap/evolution/search.py": ("tests/mobee/roadmap/evolution",),
    "services/controller/goals.py": (
        f"{CONTROLLER}/test_goals.py",
        f"{CONTROLLER}/test_node.py",
        f"{CONTROLLER}/test_client_forces.py",
        f"{CONTROLLER}/test_follow.py",
        f"{CONTROLLER}/test_reaches.py",
    ),
    "services/controller/drives.py": (f"{CONTROLLER}/test_drives.py", f"{CONTROLLER}/test_node.py", f"{CONTROLLER}/test_lockstep.py"),
}
SAMPLE = 200


def chosen(files: Sequence[str], sample: int, seed: int) -> list[tuple[str, Mutant]]:
    """Return the mutants to try: all of the safety files, and of the other files a sample by seed."""
    every = {file: mutants((ROOT / file).read_text()) for file in files}
    safety = [(file, mutant) for file in files if file in SAFETY for mutant in every[file]]
    others = [(file, mutant) for file in files if file not in SAFETY for mutant in every[file]]
    return safety + sorted(
        random.Random(seed).sample(others, min(sample, len(others))), key=lambda item: (item[0], item[1].line, item[1].column)
    )


def main() -> int:
    """Try the mutants, print each that survives, and the share that was noticed by file."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__.split("\n")[0])
    every = {**SAFETY, **OTHERS}
    parser.add_argument("files", nargs="*", metavar="FILE", help=f"default: all of {', '.join(every)}")
    parser.add_argument(
        "--sample", type=int, default=SAMPLE, metavar="N", help=f"mutants of files other than the safety files (default: {SAMPLE})"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the sample (default: 0)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result of each mutant; a file that exists is continued")
    arguments = parser.parse_args()
    for file in arguments.files:
        if file not in every:
            parser.error(f"{file!r} has no tests named in {Path(__file__).name}; valid: {', '.join(every)}")
    done: dict[str, bool] = json.loads(arguments.json.read_text()) if arguments.json and arguments.json.exists() else {}
    tried = chosen(arguments.files or list(every), arguments.sample, arguments.seed)
    with tempfile.TemporaryDirectory(prefix="mobee-mutants-") as name:
        folder = Path(name)
        copy_of_project(folder)
        for number, (file, mutant) in enumerate(tried, 1):
            key = f"{file}:{mutant}"
            if key not in done:
                done[key] = _try(folder, file, mutant, every[file])
                if arguments.json:
                    arguments.json.write_text(json.dumps(done, indent=1))
            print(f"{number} of {len(tried)} {'noticed ' if done[key] else 'SURVIVED'} {key}", flush=True)
    for file in dict.fromkeys(file for file, _ in tried):
        results = [done[f"{one}:{mutant}"] for one, mutant in tried if one == file]
        print(f"{file}: {sum(results)} of {len(results)} noticed, {100 * sum(results) / len(results):.0f} %")
    return 0


_seconds: dict[str, float] = {}  # of the tests of a file without a change


def _try(folder: Path, file: str, mutant: Mutant, tests: Sequence[str]) -> bool:
    path = folder / file
    original = path.read_text()
    if file not in _seconds:
        start = time.monotonic()
        if is_noticed(folder, tests, 600.0):
            raise SystemExit(f"{file}: its tests fail without a change, so no mutant can be judged: run pytest {' '.join(tests)}")
        _seconds[file] = time.monotonic() - start
    try:
        path.write_text(mutant.source)
        return is_noticed(folder, tests, 60.0 + 5.0 * _seconds[file])
    finally:
        path.write_text(original)


if __name__ == "__main__":
    sys.exit(main())
