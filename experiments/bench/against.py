# SPDX-License-Identifier: Apache-2.0
"""Compares the processor time of the same work in two checkouts of this repository.

A case is a piece of work with a name, in against_cases.py.  It is measured in rounds.  In each round every checkout runs in a fresh
process.  Both prepare the case and do its work once without timing; then they do it by turns (old, new, new, old, ...).  The
times are processor times, not real times, so other programs on the machine have little influence.  The ratio of a round is the sum of the
old times over the sum of the new times.  The median ratio over the rounds decides whether the new checkout passes.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from experiments.bench.against_cases import CASES
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress
from mobee.errors import MobeeError

REPOSITORY = Path(__file__).resolve().parents[2]
_CASES = Path(__file__).with_name("against_cases.py")
TURNS = 6  # of each checkout in a round
TURNS_OF_LONG_CASES = {"lockstep": 1, "trm evolution": 2}
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "NUMBA", "MKL")}

NO_SLOWER = 0.97  # least ratio of the old time to the new: two runs of one checkout differ by a little

Pair = dict[str, dict[str, Any]]  # of "old" and "new": seconds of the work, and counts of the work done


@dataclass(frozen=True, slots=True)
class Settings:
    """What `mobee bench against` compares.

    `old`, `new`: the checkouts, each the path of a folder or a commit of this repository.  `old_python`: the Python interpreter that runs
    the old one.  `cases`: names of `against_cases.CASES`.  `rounds`: number of rounds of each case.
    """

    old: str
    new: str = str(REPOSITORY)
    old_python: str = sys.executable
    cases: Sequence[str] = tuple(CASES)
    rounds: int = 5


class AgainstFailed(MobeeError):
    """Raised if a checkout does not exist, or if a case does not run in it.

    If a process failed, the message contains the last line of its output.
    """


@dataclass(frozen=True, slots=True)
class Checkout:
    """A folder with the sources of MoBeE, and the Python interpreter that runs them."""

    folder: Path
    python: str = sys.executable

    def start(self, case: str) -> Worker:
        """Start a process of this checkout that prepares the case (a name in `against_cases.CASES`), and return it."""
        return Worker(self, case)


class Worker:
    """A process of one checkout that does the work of a case.  It is a context manager: the process ends when the context is left."""

    def __init__(self, checkout: Checkout, case: str) -> None:
        self._checkout, self._case = checkout, case
        environment = {**os.environ, **_ONE_THREAD, "PYTHONPATH": str(checkout.folder)}
        argv = [checkout.python, "-P", str(_CASES), case]
        self._log = tempfile.TemporaryFile("w+")
        self._process = subprocess.Popen(
            argv, cwd=checkout.folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, text=True
        )

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None
        if error is not None:
            self._process.terminate()
        with contextlib.suppress(BrokenPipeError):  # the process has ended before
            self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()
        self._log.close()

    def await_ready(self) -> None:
        """Wait until the process has prepared the case.

        Raises AgainstFailed if it cannot, or if it imports `mobee` from another folder.
        """
        library = Path(self._answer()["library"])
        if library.parents[1] != self._checkout.folder:  # of an installed MoBeE, which may lie below the folder
            raise AgainstFailed(f"{self._case}: the library was taken from {library}, not from {self._checkout.folder}")

    def work(self) -> dict[str, Any]:
        """Do the work once and return the report of the process.

        Keys: "seconds", the processor time [s], and "work", counts of the work done.  Raises AgainstFailed if the process has ended.
        """
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # `_answer` raises with the reason
            print("again", file=self._process.stdin, flush=True)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._process.wait()
            self._log.seek(0)
            last = (self._log.read().strip().splitlines() or ["no output"])[-1]
            raise AgainstFailed(f"{self._case} in {self._checkout.folder}: {last}")
        answer: dict[str, Any] = json.loads(line)
        return answer


@contextlib.contextmanager
def checkout(folder_or_commit: str, python: str = sys.executable) -> Iterator[Checkout]:
    """Yield the checkout of a folder, or of a commit of this repository.

    A context manager: a commit is checked out into a temporary folder, which is removed at the end.  `python`: the Python interpreter that
    runs the checkout.  Raises AgainstFailed if git is missing or the commit does not exist.
    """
    if folder_or_commit and Path(folder_or_commit).is_dir():
        yield Checkout(Path(folder_or_commit).resolve(), python)
        return
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve() / "old"
        _git("worktree", "add", "--detach", str(folder), folder_or_commit)
        try:
            yield Checkout(folder, python)
        finally:
            _git("worktree", "remove", "--force", str(folder))


def build_core(checkout: Checkout) -> None:
    """Build the native core of a checkout by its script core/build.py, if it has this script.  Raises AgainstFailed if the build fails."""
    script = checkout.folder / "core" / "build.py"
    if script.exists():
        done = subprocess.run([checkout.python, str(script)], cwd=checkout.folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise AgainstFailed(f"core/build.py in {checkout.folder}: {(done.stderr.strip().splitlines() or ['failed'])[-1]}")


def _git(*words: str) -> None:
    try:
        subprocess.run(["git", "-C", str(REPOSITORY), *words], capture_output=True, text=True, check=True)
    except FileNotFoundError:
        raise AgainstFailed("git is not installed: give a folder instead of a commit") from None
    except subprocess.CalledProcessError as error:
        raise AgainstFailed(f"git {words[0]}: {error.stderr.strip().splitlines()[-1]}") from None


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises AgainstFailed if a checkout cannot be measured.

    If a checkout is given as a commit, its native core is built first.  Main keys: "cases", a dict from the name of each case to the times
    of both checkouts and their ratio, as `compared` returns them; "requirements", a list with the dict that `Requirement.judge` returns for
    each requirement; "passed", whether all are met.
    """
    with checkout(settings.old, settings.old_python) as old, checkout(settings.new) as new:
        for given, one in ((settings.old, old), (settings.new, new)):
            if not Path(given).is_dir():
                build_core(one)
        return measure_checkouts(old, new, settings.cases, settings.rounds)


def measure_checkouts(old: Checkout, new: Checkout, cases: Sequence[str], rounds: int) -> dict[str, Any]:
    """Measure the cases in two checkouts and return the result; raises AgainstFailed if a case does not run in one of them.

    `cases`: names in `against_cases.CASES`.  `rounds`: number of rounds of each case.  Keys: "rounds", this number; "cases", a dict from
    the name of each case to the times of both checkouts and their ratio, as `compared` returns them; "requirements", a list with a dict for
    each case, as `Requirement.judge` returns it; "passed", whether all requirements are met.  The requirement of a case is that the ratio
    of the old time to the new one is at least 0.97.
    """
    pairs: dict[str, list[Pair]] = {case: [] for case in cases}
    with Progress() as progress:
        for done in range(len(cases) * rounds):
            number, index = divmod(done, len(cases))
            case = cases[index]
            progress.show(done / (len(cases) * rounds), f"{case}, round {number + 1} of {rounds}")
            pairs[case].append(_round(old, new, case, turns=TURNS_OF_LONG_CASES.get(case, TURNS)))
    result = {"rounds": rounds, "cases": {case: compared(of_case) for case, of_case in pairs.items()}}
    return result | verdict(result, [Requirement(case, ("cases", case, "ratio"), at_least=NO_SLOWER) for case in cases])


def _round(old: Checkout, new: Checkout, case: str, turns: int) -> Pair:
    seconds = {"old": 0.0, "new": 0.0}
    with old.start(case) as one, new.start(case) as other:
        workers = {"old": one, "new": other}
        for worker in workers.values():
            worker.await_ready()
        work = {}
        for turn in range(turns):
            for name in ("old", "new") if turn % 2 == 0 else ("new", "old"):
                answer = workers[name].work()
                seconds[name] += answer["seconds"]
                work[name] = answer["work"]
    return {name: {"seconds": seconds[name] / turns, "work": work[name]} for name in workers}


def compared(rounds: Sequence[Pair]) -> dict[str, Any]:
    """Return the statistics of one case over its rounds.

    `rounds`: for each round a dict with the keys "old" and "new".  Each value is a dict with "seconds", the mean processor time of one run
    of the work [s], and "work", a dict of numbers that say what was done, by which the work of two checkouts is compared.  Keys of the
    result: "old_s" and "new_s", median times [s]; "ratio", the median of the old time over the new one; "quartiles" and "range" of this
    ratio, two numbers each; "work", the "work" of each checkout in the last round; "same_work", whether the two are equal.
    """
    old, new = (np.array([one[which]["seconds"] for one in rounds]) for which in ("old", "new"))
    ratios = old / new
    lower, middle, upper = np.percentile(ratios, [25, 50, 75])
    work = {which: rounds[-1][which]["work"] for which in ("old", "new")}
    return {
        "old_s": float(np.median(old)),
        "new_s": float(np.median(new)),
        "ratio": float(middle),
        "quartiles": [float(lower), float(upper)],
        "range": [float(ratios.min()), float(ratios.max())],
        "same_work": work["old"] == work["new"],
        "work": work,
    }


def report(result: Mapping[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each case, then the requirements."""
    lines = [f"Processor time of the same work, medians of {result['rounds']} rounds; ratio: old over new"]
    lines.append(f"{'':<20}{'old, s':>9}{'new, s':>9}{'ratio':>8}{'quartiles':>15}{'range':>15}")
    for case, one in result["cases"].items():
        quartiles, spread = (f"{low:.2f} - {high:.2f}" for low, high in (one["quartiles"], one["range"]))
        lines.append(f"{case:<20}{one['old_s']:>9.3f}{one['new_s']:>9.3f}{one['ratio']:>8.2f}{quartiles:>15}{spread:>15}")
        if not one["same_work"]:
            lines += [f"    {which}: {_counts_text(work)}" for which, work in one["work"].items()]
    return report_text([*lines, "required"], result)


def _counts_text(work: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {count:g}" for name, count in work.items())
