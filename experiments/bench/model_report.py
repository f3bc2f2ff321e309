"""What `mobee bench model` prints."""

from __future__ import annotations

from typing import Any

from experiments.bench.agreement import GRAZE
from experiments.bench.model import KINEMATICS, MUJOCO, PAIRS, TREES

_PEERS = (MUJOCO, PAIRS, TREES)
_MUJOCO_NOTE = (
    """MuJoCo's depths of boxes are of another kind: of each point of a contact along one normal, and of a capsule's end in a box."""
)


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    about = result["workload"]
    head = (
        f"{about['motors']} motors, {about['joints']} joints, {about['primitives']} primitives, {about['pairs']} pairs of them, "
        f"and N boxes\n{'not pinned' if result['core'] is None else 'one core'}, {about['rounds']} rounds, medians; the speed of the "
        "machine drifts: compare ratios only"
    )
    return "\n\n".join([head, *_tables(result), _requirements(result), _agreement(result)])


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
    lines = ["required"]
    for one in result["requirements"]:
        aim = f", aim {one['aim']:g}" if one["aim"] else ""
        what = f"{one['name']}, N = {one['boxes']}: at least {one['least']:g} x {one['peer']}{aim}"
        lines.append(f"  {what:<64} {one['ratio']:7.1f}  {'pass' if one['passed'] else 'SHORT'}")
    return "\n".join(lines)


def _agreement(result: dict[str, Any]) -> str:
    lines = [f"agreement (a pair that overlaps by less than {GRAZE:g} m may differ)"]
    for one in result["agreement"]:
        differing = f"{one['other_pairs']} pairs differ" + (f", the deepest by {one['deepest_other']:.1e} m" if one["other_pairs"] else "")
        depths = ", ".join(f"{kinds} {difference:.0e}" for kinds, difference in one["depth_difference"].items())
        verdict = "pass" if one["passed"] else "DIFFERS"
        lines.append(f"  {one['peer']}, N = {one['boxes']}, {one['poses']} poses: {one['contacts']} contacts, {differing}  {verdict}")
        lines.append(f"    depths differ at most [m]: {depths}")
    if not result["coal"]:
        lines.append("  coal: not installed; from MoBeE's folder: pip install '.[dev]'")
    return "\n".join([*lines, f"  {_MUJOCO_NOTE}"])


def _thousands(rate: float) -> str:
    return f"{rate:,.0f}".replace(",", " ")
