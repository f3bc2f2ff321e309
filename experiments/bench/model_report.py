"""What `mobee bench model` prints."""

from __future__ import annotations

import textwrap
from typing import Any

from experiments.bench import verdicts as requirement
from experiments.bench.agreement import GRAZE, MINIMAL
from experiments.bench.model import BATCH, CALL, KINEMATICS, MUJOCO, PAIRS, TREES

_PEERS = (MUJOCO, PAIRS, TREES)
_WIDTH = 80
_NOTE = (
    f"differ: pairs that touch for one of the two only, and how deep the deepest is (less than {GRAZE:g} m is no difference); "
    f"same depths: within {MINIMAL:g} m of the peer's, which need not be minimal; "
    "longer: ours than the way out along the peer's normal, at most [m]"
)


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    about = result["workload"]
    head = _wrapped(
        f"{about['motors']} motors, {about['joints']} joints, {about['primitives']} primitives, {about['pairs']} tested pairs; N boxes. "
        f"Processor time {'of one core' if result['core'] is not None else '(not pinned to a core)'}, medians of {about['rounds']} rounds: "
        "ratios can be compared, rates only within one run."
    )
    required = "\n".join(["required", *requirement.lines(result["requirements"])])
    return "\n\n".join([head, *_tables(result), _others(result), required, *([_agreement(result)] if result["agreement"] else [])])


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


def _others(result: dict[str, Any]) -> str:
    """Robots of other makers, and threads."""
    lines = ["robots of other makers                poses per second          times MuJoCo"]
    lines.append(f"  {'N':>20}{'batch':>12}{'one call':>10}{'MuJoCo':>10}{'batch':>12}{'one call':>10}")
    for name, found in result["others"].items():
        for count, rates in found["poses_per_second"].items():
            ratios = found["times_mujoco"][count]
            lines.append(
                f"  {name:<16}{count:>4}{_thousands(rates[BATCH]):>12}{_thousands(rates[CALL]):>10}{_thousands(rates[MUJOCO]):>10}"
                f"{ratios[BATCH]:>12.2f}{ratios[CALL]:>10.2f}"
            )
    threads = result["threads"]
    if threads is not None:
        lines.append(f"  a batch on 2 threads: {threads['gain']:.2f} x one; 2 processes at once: {threads['processes']:.2f} x one")
    return "\n".join(lines)


def _agreement(result: dict[str, Any]) -> str:
    lines = [f"{'agreement':<18}{'N':>4}{'':<12}{'contacts':>8}{'differ':>10}{'same depths':>12}{'longer':>8}"]
    for one in result["agreement"]:
        differing = f"{one['other_pairs']}" + (f", {one['deepest_other']:.0e}" if one["other_pairs"] else "")
        lines.append(
            f"  {one['scene']:<16}{one['objects']:>4}  {one['peer']:<10}{one['contacts']:>8}{differing:>10}"
            f"{100.0 * one['same_depths']:>10.1f} %{one['beaten']:>8.0e}{'' if one['passed'] else ' DIFFERS'}"
        )
    if not result["coal"]:
        lines.append("  coal: not installed: pip install '.[dev]' in MoBeE's folder")
    return "\n".join([*lines, _wrapped(_NOTE, "  ")])


def _wrapped(text: str, indent: str = "") -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=indent, subsequent_indent=indent)


def _thousands(rate: float) -> str:
    return f"{rate:,.0f}".replace(",", " ")
