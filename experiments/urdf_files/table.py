"""The files as a table of Markdown, one line each, and their sums."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Any

from experiments.urdf_files.looked_at import LookedAt

HEAD = ("file", "motors", "links", "SRDF: home", "frames off", "contacts: coal, differ", "at home: as loaded, no SRDF", "load s")


def numbers(found: Sequence[LookedAt]) -> dict[str, Any]:
    """Sums over some files."""
    loaded = [one for one in found if one.outcome == "loads"]
    compared = [one for one in loaded if one.contacts >= 0]
    seconds = sorted(one.seconds for one in loaded)
    return {
        "files": len(found),
        "things": sum(one.outcome == "thing" for one in found),
        "refused": sum(one.outcome == "refused" for one in found),
        "crashes": sum(one.outcome == "crash" for one in found),
        "load": len(loaded),
        "links": sum(one.links for one in loaded if one.links >= 0),
        "frame_error": max((one.frame_error for one in loaded if not isnan(one.frame_error)), default=0.0),
        "compared_with_coal": len(compared),
        "contacts": sum(one.contacts for one in compared),
        "other_contacts": sum(one.other for one in compared),
        "srdf_found": sum(bool(one.srdf) for one in loaded),
        "touch_at_home": sum(one.at_home > 0 for one in loaded),
        "touch_at_home_without_srdf": sum(one.at_home_without > 0 for one in loaded),
        "load_median_s": round(seconds[len(seconds) // 2], 3) if seconds else 0.0,
        "load_most_s": round(max(seconds, default=0.0), 2),
    }


def write_table(found: Sequence[LookedAt], path: Path) -> None:
    """One line a file: first those that load, then what is refused, then things without a moving joint."""
    loads, refused, things = ([one for one in found if one.outcome in kinds] for kinds in (("loads",), ("refused", "crash"), ("thing",)))
    lines = [_row(HEAD), _row(["---"] * len(HEAD)), *(_row(_cells(one)) for one in loads)]
    lines += ["", _row(("refused", "why")), _row(("---", "---")), *(_row((one.name, one.message)) for one in refused)]
    lines += ["", f"Without a moving joint ({len(things)}): {', '.join(one.name for one in things)}."]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _cells(one: LookedAt) -> tuple[str, ...]:
    srdf = f"{one.srdf}: {one.home or 'zero'}" if one.srdf else ""
    frames = "" if isnan(one.frame_error) else f"{one.frame_error:.0e}"
    contacts = f"{one.contacts}, {one.other}" if one.contacts >= 0 else one.message
    return (
        one.name, str(one.motors), str(max(one.links, 0) or ""), srdf, frames, contacts, f"{one.at_home}, {one.at_home_without}",
        f"{one.seconds:.2f}",
    )  # fmt: skip
