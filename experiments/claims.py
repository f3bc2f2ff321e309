"""What was published, what we found, and whether it holds."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Literal, get_args

from mobee.errors import UnknownName

Verdict = Literal["confirmed", "refuted", "open"]


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
