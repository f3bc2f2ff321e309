"""What was published, what we found, and whether it holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

from mobee.errors import UnknownName

Verdict = Literal["confirmed", "refuted", "open"]
LEAST_SEEDS = 5  # for a verdict: a bootstrap of fewer values is too narrow, of one it has no width


@dataclass(frozen=True)
class Claim:
    """A row of the table of claims.

    An experiment lists its claims as CLAIMS = (Claim(source, text, published), ...), and returns them measured, as dicts, under
    "claims" in its results.  `source`: where it was published, as "thesis 7.2.1, fig. 7.5".  `ours`: our number with its interval.
    """

    source: str
    text: str
    published: str
    ours: str = ""
    verdict: Verdict = "open"

    def __post_init__(self) -> None:
        if self.verdict not in get_args(Verdict):
            raise UnknownName("verdict", self.verdict, get_args(Verdict))

    def measured(self, ours: str, holds: bool | None) -> Claim:
        """With our number; it holds, does not, or that is open (None)."""
        return replace(self, ours=ours, verdict="open" if holds is None else "confirmed" if holds else "refuted")

    def record(self) -> dict[str, str]:
        """As a dict for JSON."""
        return asdict(self)


def open_with_few_seeds(results: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Results of an experiment with its claims open, where its runs have too few `seeds` for a verdict; the numbers stay."""
    seeds = options.get("seeds")
    if seeds is None or seeds >= LEAST_SEEDS or "claims" not in results:
        return dict(results)
    return {**results, "claims": [_undecided(Claim(**claim), seeds).record() for claim in results["claims"]]}


def _undecided(claim: Claim, seeds: int) -> Claim:
    if claim.verdict == "open":
        return claim
    return claim.measured(f"{claim.ours} ({seeds} {'seed' if seeds == 1 else 'seeds'}, too few for a verdict)", None)
