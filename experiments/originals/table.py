"""The table of original files: a record a file, and all of them as a page."""

from __future__ import annotations

from pathlib import Path

RECORDS, TABLE = "originals.csv", "originals.md"
COLUMNS = ("kind", "date", "file", "hash", "loads", "read_as", "motors", "shapes", "poses", "contacts", "place", "agrees")
HEADINGS = ("first seen", "file", "Git hash", "motors", "shapes or objects", "read as, or why not", "poses, contacts", "agree")


def write_table(rows: list[dict[str, str]], path: Path) -> None:
    """Write all rows as a Markdown table, robots and then worlds."""
    lines = [f"| {' | '.join(HEADINGS)} |\n", "|---" * len(HEADINGS) + "|\n"]
    for row in sorted(rows, key=lambda one: (one["kind"], one["date"], one["file"], one["hash"])):
        compared = f"{row['poses']}, {row['contacts']}" if row["poses"] else ""
        read_as = row["read_as"] if row["loads"] == "yes" else f"**refused**: {row['read_as']}"
        cells = (row["date"], row["file"], row["hash"][:10], row["motors"], row["shapes"], read_as, compared, row["agrees"])
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |\n")
    path.write_text("".join(lines), encoding="utf-8")
