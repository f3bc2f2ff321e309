# SPDX-License-Identifier: Apache-2.0
"""The frozen rules: the claims of each experiment and the constants of its module, among them all thresholds, in `frozen.json`.

They were chosen while the first seeds were looked at.  After they are frozen, each experiment is run once with new seeds, and judged by the
same rules.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.kit import rules, statistics
from experiments.kit.experiment import MIN_SEEDS
from experiments.registry import EXPERIMENTS, load_experiment
from mobee.errors import InvalidValue

FROZEN = Path(__file__).with_name("frozen.json")
CONFIRMING_SEED = 1000  # the first of the new seeds
_ALL = "all"  # name of the constants that all experiments share


def rules_of(name: str) -> dict[str, Any]:
    """Return the claims of an experiment, and the plain constants of its module, as JSON has them."""
    module = importlib.import_module(EXPERIMENTS[name])
    claims = [{"text": claim.text, "published": claim.published} for claim in load_experiment(name).claims]
    return {"claims": claims, "constants": _plain(_constants(module))}


def shared_rules() -> dict[str, Any]:
    """Return the constants that the rules of all experiments use."""
    return {"constants": _plain({"MIN_SEEDS": MIN_SEEDS} | _constants(statistics) | _constants(rules))}


def freeze(names: Sequence[str]) -> None:
    """Write the rules of those of these experiments that have claims into `frozen.json`; the others stay as they are frozen."""
    kept = frozen() | {_ALL: shared_rules()} | {name: rules_of(name) for name in names if load_experiment(name).claims}
    FROZEN.write_text(json.dumps(dict(sorted(kept.items())), indent=1) + "\n")


def frozen() -> dict[str, Any]:
    """Return the frozen rules by experiment; empty if none are frozen."""
    return dict(json.loads(FROZEN.read_text())) if FROZEN.exists() else {}


def require_frozen(name: str) -> None:
    """Raise InvalidValue unless the rules of an experiment are the frozen ones."""
    kept = frozen()
    for key, found in ((_ALL, shared_rules()), (name, rules_of(name))):
        if kept.get(key) != found:
            raise InvalidValue(
                f"the rules of {name!r} are not those of {FROZEN.name}: new seeds confirm only rules that were frozen before."
            )


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
