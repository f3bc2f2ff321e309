"""What `mobee bench model` prints."""

from __future__ import annotations

import textwrap
from typing import Any

from experiments.bench.agreement import GRAZE
from experiments.bench.model import KINEMATICS, MUJOCO, PAIRS, TREES

_PEERS = (MUJOCO, PAIRS, TREES)
_WIDTH = 80
_NOTE = "MuJoCo's depths are not judged: with a box they are per point of contact, of a capsule as of spheres on its axis."


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    about = result["workload"]
    head = _wrapped(
        f"{about['motors']} motors, {about['joints']} joints, {about['primitives']} primitives, {about['pairs']} tested pairs; N boxes. "
        f"Processor time {'of one core' if result['core'] is not None else '(not pinned to a core)'}, medians of {about['rounds']} rounds: "
        "ratios can be compared, rates only within one run."
    )
    return "\n\n".join([head, *_tables(result), _requirements(result), *([_agreement(result)] if result["agreement"] else [])])


def _tables(result: dict[str, Any]) -> list[str]:
    rates = result["poses_per_second"]
    rows = {name: [_thousands(found[name]) for found in rates.values()] for name in next(iter(rates.values()))}
    tables = [_table("poses per second", rates, rows)]
    for key, title in (("times_mujoco", "times MuJoCo"), ("times_python_fcl", "times python-fcl, pair by pair")):
        ours = [name for name in rows if name not in _PEERS and name != KINEMATICS]
        tables.append(_table(title, rates, {name: [f"{found[name]:.1f}" for found in result[key].values()] for name in ours}))
    return tables


def _table(title: str, boxes: dict[int, Any], rows: dict[str, list[str]]) -> str:
    lines = [f"{title:<34}" + "".join(f"{f'N = {count}':>11}" for count in boxes)]
    for name, cells in rows.items():
        lines.append(f"  {name if name in _PEERS else f'ours, {name}':<32}" + "".join(f"{cell:>11}" for cell in cells))
    return "\n".join(lines)


def _requirements(result: dict[str, Any]) -> str:
    lines = ["required, at least"]
    for one in result["requirements"]:
        aim = f", aim {one['aim']:g}" if one["aim"] else ""
        what = f"{one['name']}, N = {one['boxes']}: {one['least']:g} x {one['peer']}{aim}"
        lines.append(f"  {what:<60}{one['ratio']:9.1f}  {'pass' if one['passed'] else 'SHORT'}")
    return "\n".join(lines)


def _agreement(result: dict[str, Any]) -> str:
    lines = [f"agreement (a pair that overlaps by less than {GRAZE:g} m may differ)"]
    for one in result["agreement"]:
        differing = f"{one['other_pairs']} pairs differ" + (f", the deepest by {one['deepest_other']:.1e} m" if one["other_pairs"] else "")
        depths = ", ".join(f"{kinds} {difference:.0e}" for kinds, difference in one["depth_difference"].items())
        verdict = "pass" if one["passed"] else "DIFFERS"
        lines.append(f"  {one['peer']}, N = {one['boxes']}, {one['poses']} poses: {one['contacts']} contacts, {differing}  {verdict}")
        lines.append(_wrapped(f"depths differ at most [m]: {depths}", "    "))
    if not result["coal"]:
        lines.append("  coal: not installed: pip install '.[dev]' in MoBeE's folder")
    return "\n".join([*lines, _wrapped(_NOTE, "  ")])


def _wrapped(text: str, indent: str = "") -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=indent, subsequent_indent=indent)


def _thousands(rate: float) -> str:
    return f"{rate:,.0f}".replace(",", " ")
