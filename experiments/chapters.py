# SPDX-License-Identifier: Apache-2.0
"""The published claims by chapter of the thesis: a part of docs/results.md, written by `mobee experiment claims --write`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from experiments.kit.experiment import VERDICTS, Claim

PAGE = Path(__file__).parent.parent / "docs" / "results.md"
BEGIN = "<!-- written by `mobee experiment claims --write` -->"
END = "<!-- end of what it writes -->"
CHAPTERS = {
    1: "Introduction: planning is too slow to be used online",
    3: "Task-relevant roadmaps: poses by evolution, one graph for each task",
    4: "Roadmaps that adapt to bumps",
    5: "Reactive control: a coarse planner and a reactive reach need each other",
    6: "The curious agent: information gain as a reward",
    7: "Curiosity learns the outcomes of the robot's own actions (with the paper)",
    8: "Curiosity learns to reach",
    9: "Discussion: what the thesis leaves to others",
}
_PAPER = 7  # chapter of the claims that are in the paper alone
_PARTS: dict[str, tuple[str, ...]] = {
    "Holds": ("confirmed", "stronger"),
    "Depends on what the texts leave open": ("depends",),
    "Does not hold here": ("refuted", "not reproduced"),
    "Open": ("open",),
}


def chapter_of(claim: Claim) -> int:
    """Return the number of the first thesis chapter that the claim's source names; 7 if the source names only the paper.

    The paper is Frank et al., Frontiers in Neurorobotics 7:25, 2014; it has the topic of chapter 7.
    """
    found = re.search(r"thesis (\d+)", claim.source)
    return int(found[1]) if found else _PAPER


def section(table: Sequence[tuple[str, Claim]], untested: Callable[[str, str], str]) -> str:
    """Return the published claims as Markdown: a section for each chapter of the thesis, with the claims grouped by verdict.

    `table`: pairs of an experiment's name and one of its claims; claims that are aims of our own, not published, are left out.  `untested`:
    function that takes the name of an experiment and the text of a claim.  It returns, as text, the conditions that the publications do not
    specify and that no run varied ("" if there are none).
    """
    published = [(name, claim) for name, claim in table if not claim.is_aim]
    lines = list[str]()
    for number, title in CHAPTERS.items():
        mine = [(name, claim) for name, claim in published if chapter_of(claim) == number]
        if not mine:
            continue
        lines += [f"### Chapter {number}", "", f"{title}. Claims: {_counts([claim for _, claim in mine])}.", ""]
        for part, verdicts in _PARTS.items():
            chosen = [(name, claim) for name, claim in mine if claim.verdict in verdicts]
            lines += [f"**{part}**", "", *(_line(claim, untested(name, claim.text)) for name, claim in chosen), ""] if chosen else []
    return "\n".join(lines).rstrip()


def _counts(claims: Sequence[Claim]) -> str:
    numbers = {verdict: sum(claim.verdict == verdict for claim in claims) for verdict in VERDICTS}
    return ", ".join(f"{number} {verdict}" for verdict, number in numbers.items() if number)


def _line(claim: Claim, untested: str) -> str:
    return "- " + ". ".join(part[0].upper() + part[1:] for part in _parts(claim, untested)) + "."


def _parts(claim: Claim, untested: str) -> Iterator[str]:
    yield f"{claim.text} ({claim.source})"
    if claim.verdict == "stronger":
        yield f"stronger than published ({claim.published}): {claim.ours}"
    elif claim.verdict in ("depends", "refuted", "not reproduced"):
        yield f"published: {claim.published}; here: {claim.ours}"
        if claim.settings:
            yield claim.settings
        if claim.verdict == "not reproduced":
            yield f"not varied: {untested}" if untested else "measured in one setting"
    elif claim.verdict == "open" and claim.ours:
        yield f"here: {claim.ours}"


def with_section(page: str, text: str) -> str:
    """Return the Markdown page `page` with `text` in place of everything between its two comments BEGIN and END."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.partition(END)[2]}"
