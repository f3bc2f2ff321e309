# SPDX-License-Identifier: Apache-2.0
"""The frozen rules: the claims of each experiment and the constants of its module, among them the thresholds, in `frozen.json`.

The rules were chosen when the results of the first runs, with the first seeds, were already known.  Then they are frozen, that is, written
to the file.  After that, an experiment can be run once with new seeds, and is judged by the frozen rules.  After this run, `freeze` raises
InvalidValue if the rules of the experiment would change.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from experiments.kit import rules, statistics
from experiments.kit.experiment import MIN_SEEDS
from experiments.kit.raw_records import record_path
from experiments.kit.run_folder import read
from experiments.registry import EXPERIMENTS, load_experiment
from mobee.errors import InvalidValue

FROZEN = Path(__file__).with_name("frozen.json")
CONFIRMING_SEED = 1000  # the first of the new seeds
_ALL = "all"  # name of the constants that all experiments share

Rules = dict[str, dict[str, Any]]  # "claims": published values by text; "constants": by name


def rules_of(name: str) -> Rules:
    """Return the rules of an experiment as JSON values, under two keys.

    "claims": dict from the text of each claim to its published number.  "constants": dict from the name of each public constant to its
    value.  The constants are those of the experiment's module, and of those modules of `experiments.claims` that it imports as whole
    modules.  Only constants whose values are numbers, texts, or collections of them are included.
    """
    module = importlib.import_module(EXPERIMENTS[name])
    imported = [one for one in vars(module).values() if isinstance(one, ModuleType) and one.__name__.startswith("experiments.claims.")]
    constants = {key: value for one in (*imported, module) for key, value in _constants(one).items()}
    return {"claims": {claim.text: claim.published for claim in load_experiment(name).claims}, "constants": _plain(constants)}


def shared_rules() -> Rules:
    """Return the constants that the rules of all experiments use, by name, under the key "constants"."""
    return {"constants": _plain({"MIN_SEEDS": MIN_SEEDS} | _constants(statistics) | _constants(rules))}


def freeze(names: Sequence[str]) -> list[str]:
    """Write the rules of the named experiments, and the constants that all experiments share, into `frozen.json`.

    Names of experiments without claims are ignored; experiments that are not named keep their frozen rules.  Returns the names of the
    experiments whose rules were written.  Raises InvalidValue if the rules of an experiment that has been run with new seeds would change.
    """
    before = frozen()
    written = {name: rules_of(name) for name in names if load_experiment(name).claims}
    kept = before | {_ALL: shared_rules()} | written
    for name in (name for name in EXPERIMENTS if record_path(name, confirms=True).exists()):
        if changed := [*_changed(before, _ALL, kept[_ALL]), *(_changed(before, name, kept[name]) if name in kept else [])]:
            raise InvalidValue(
                f"{name!r} has been run with new seeds, so its rules stay as they are frozen; changed: {', '.join(changed)}."
            )
    FROZEN.write_text(_text(kept))
    return list(written)


def frozen() -> dict[str, Rules]:
    """Return the frozen rules by the experiment's name, and under "all" the constants that all experiments share.

    The dict is empty if no rules are frozen.  Raises InvalidValue if the file is damaged.
    """
    return read(FROZEN) if FROZEN.exists() else {}


def require_frozen(name: str) -> None:
    """Raise InvalidValue if the rules of an experiment, or the constants that all experiments share, differ from the frozen ones."""
    kept = frozen()
    if changed := [*_changed(kept, _ALL, shared_rules()), *_changed(kept, name, rules_of(name))]:
        raise InvalidValue(
            f"the rules of {name!r} are not those of {FROZEN.name} (changed: {', '.join(changed)}): new seeds confirm only rules that were "
            "frozen before."
        )


def _changed(kept: Mapping[str, Rules], name: str, found: Rules) -> list[str]:
    """Return the texts of claims and the names of constants that differ from the frozen ones."""
    if name not in kept:
        return ["the constants of all experiments are not frozen" if name == _ALL else f"{name} is not frozen"]
    before, after = (
        {(key, json.dumps(value, sort_keys=True)) for its in one.values() for key, value in its.items()} for one in (kept[name], found)
    )
    return sorted({key for key, _ in before ^ after})


def _text(kept: Mapping[str, Rules]) -> str:
    """Return the rules as JSON with a line for each claim and constant, so that a difference between two versions names them."""

    def block(indent: str, its: Mapping[str, str]) -> str:
        inside = ",\n".join(f"{indent} {json.dumps(key)}: {text}" for key, text in its.items())
        return f"{{\n{inside}\n{indent}}}"

    def each(one: Rules) -> str:
        return block(" ", {kind: block("  ", {key: json.dumps(value) for key, value in its.items()}) for kind, its in one.items()})

    return block("", {name: each(kept[name]) for name in sorted(kept)}) + "\n"


def _constants(module: Any) -> dict[str, Any]:
    """Return the constants of a module whose values are numbers, texts, or collections of them."""
    return {name: value for name, value in sorted(vars(module).items()) if name.isupper() and not name.startswith("_") and _is_plain(value)}


def _is_plain(value: object) -> bool:
    if isinstance(value, dict):
        return all(_is_plain(one) for one in (*value.keys(), *value.values()))
    if isinstance(value, (tuple, list, set, frozenset)):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, (bool, int, float, str))


def _plain(value: Any) -> Any:
    """Return a value as JSON has it; keys are texts, and sets are sorted."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (set, frozenset)):
        return sorted(map(_plain, value))
    return [_plain(one) for one in value] if isinstance(value, (tuple, list)) else value
