# SPDX-License-Identifier: Apache-2.0
"""Rebuilds a reach agent (an agent that has learned to reach targets) from the SQLite file of the run in which it learned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mobee.arrays import Array
from mobee.errors import MobeeError, UnknownName
from mobee.learning.reaching.changes import NONE
from mobee.learning.reaching.learner import ReachSettings
from mobee.learning.reaching.predictors import PREDICTORS, Reaches, RewardPredictor
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.reaches import reaches_of
from mobee.learning.reaching.store import ReachStore, reaching_parts
from mobee.learning.record import load_learned, space_from
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.reach import ReachPlant
from mobee.store import TransitionStore


def load_reaches(
    file: str | Path, plant: ReachPlant, part: str | None = None, hands: Array | None = None, jacobians: Array | None = None
) -> ReachAgent:
    """Rebuild a reach agent, which has learned to reach targets, from the file of a run. Its strategy is "greedy", and it stores nothing.

    It plans with the outcomes of the part's transitions that are stored in the same file. If the file has none for the agent's space
    (states and actions), the agent assumes at first that every action most probably ends in its goal.

    Args:
        file: the SQLite file of the run in which the agent learned.
        plant: the robot on which the agent acts.
        part: the agent's part; None is valid if the file contains the reaches of one part.
        hands: (S, 3) m, root frame, position of the marker in each state; None: computed by kinematics.
        jacobians: (S, 3, d) m/rad, derivatives of `hands` with respect to the joints; None: computed, or unknown if `hands` are given.

    Raises:
        MobeeError, UnknownName: no such file or part, no reaches in the file, or a predictor that is not in `PREDICTORS`.
    """
    if not Path(file).is_file():
        raise MobeeError(f"{file}: there is no such file; runs of `mobee launch` write such files.")
    with ReachStore(file, _part_of(file, part), read_only=True) as store:
        bound, learners, targets, steps = store.settings(), store.learners(), store.problems(), store.load()
    learner = learners[-1][1]
    space = space_from(bound["space"], plant.robot)
    marker, scale = bound["marker"], bound["scale"]
    reaches = reaches_of(space, marker, scale) if hands is None else Reaches(space.samples, hands, scale, jacobians)
    model = _model(file, space)
    settings = ReachSettings(
        predictor=_predictor(file, learner["predictor"], reaches),
        strategy="greedy",
        scale=scale,
        detector=learner.get("detector", NONE),
        **{name: learner[name] for name in ("failures", "discount", "penalty", "limit", "seed")},
    )
    agent = ReachAgent(
        space,
        plant,
        model.debiased(),
        marker=marker,
        settings=settings,
        model=model if learner["learns the model"] else None,
        hands=reaches.hands,
        jacobians=reaches.jacobians,
    )
    agent.replay(targets, steps)
    return agent


def _part_of(file: str | Path, part: str | None) -> str:
    parts = reaching_parts(file)
    if part is None and len(parts) == 1:
        return parts[0]
    if not parts:
        raise MobeeError(f"{file}: no agent has learned to reach in this run yet; run a ReachAgent with a ReachStore on this file.")
    if part is None:
        raise MobeeError(f"{file} holds the reaches of several parts: name one of {', '.join(parts)}.")
    if part not in parts:
        raise UnknownName("part that learned to reach", part, parts)
    return part


def _model(file: str | Path, space: Space) -> TransitionModel:
    with TransitionStore(file, space.part, read_only=True) as store:
        known = space.part in store.agents() and store.settings().get("space") == space.settings
    return load_learned(file, space.part, space.robot).model if known else TransitionModel(space)


def _predictor(file: str | Path, settings: dict[str, Any], reaches: Reaches) -> RewardPredictor:
    name = settings.get("name")
    if name not in PREDICTORS:
        raise UnknownName("predictor on record", name, PREDICTORS)
    predictor = PREDICTORS[name](reaches)
    if predictor.settings != settings:
        raise MobeeError(
            f"{file}: the predictor on record has the settings {settings}, one made now {predictor.settings}: "
            "make a ReachAgent with that predictor and this file's ReachStore."
        )
    return predictor
