# SPDX-License-Identifier: Apache-2.0
"""Put a cup beside the arm of a curious agent whose state contains the place of the cup, and let the arm push the cup to chosen cells.

Claim: a curious agent whose state contains the place of a cup moves the cup more often than an agent that perceives only a ghost of the
cup.  With what it has learned it pushes the cup to a chosen cell more often than by chance.
Source: aim of this reproduction; it extends the discovery of a table in paper 3.2.  Published number: none.
Run time: 4 minutes of processor time.

The left arm has 15 postures in which the hand is low above the table, and the cup can be in nine cells of 5 x 8 cm: 135 states, 396
actions.  The contacts of hand and cup have no friction (`mobee.SlidingObject`), so that the cup slides off the hand; it is put back to its
first place, in the middle cell, when it topples or leaves the cells.  Its place is perceived with an error of 3 mm.  In all runs a real cup
stands there, and its motions are counted.  The runs differ in what the agent perceives as the place of the cup: the true place; a ghost
that rests at the first place; or a ghost that repeats the motion of the cup in another run, so that the agent's actions do not cause it.
The replayed ghost is the stricter control: its agent has as many states, and as much to learn, as the one that perceives the cup.  An
action has moved the cup if it pushed it by more than 1 cm or made it fall.
After 2000 actions, the agent plans with its transition model to push the cup from the middle to each of the five cells to which the hand
can push it, each six times, with at most 20 actions.
--arrangements: also runs with other postures, and with a grid of twelve cells, in which the first place of the cup is beside the middle of
the grid.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, judged
from experiments.kit.learning.pushing import ARRANGEMENTS, Arrangement, Stage, push_to
from experiments.kit.plots import draw_bars, draw_curve, finish, new_figure
from experiments.kit.rules import of_each, row, stands_above, texts
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee.arrays import Array

TRANSITIONS, QUICK = 2000, 60
TRIES, MOST = 30, 20  # tries to push the cup to a cell, and actions of each
LEAST = 0.01  # m of a push that counts
OTHER_RUN = 1000  # added to the seed of the run whose cup is replayed
WINDOW = 200  # transitions of a point of the figure
CUP, STILL, REPLAYED, RANDOM = "perceives the cup", "perceives a ghost at rest", "perceives a replayed ghost", "random actions"
AGENTS: Mapping[str, tuple[str, str]] = {  # explorer, and what it perceives
    CUP: ("curious", "cup"),
    STILL: ("curious", "still"),
    REPLAYED: ("curious", "replayed"),
    RANDOM: ("random", "cup"),
}
COLORS = dict(zip(AGENTS, ("C3", "C0", "C2", "0.5"), strict=True))
MAIN = next(iter(ARRANGEMENTS))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option --arrangements, which also runs the other arrangements of postures and cells."""
    parser.add_argument("--arrangements", action="store_true", help="also with other postures and another grid")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: each of four agents in the first arrangement, or with --arrangements in all three.

    An arrangement is a set of postures of the hand and a grid of cells on the table.  Three agents are curious.  The first perceives the
    true place of the cup.  The second and the third perceive the place of an imaginary cup (a ghost) instead: one that rests, or one that
    repeats the motion of the cup in another run.  The fourth agent acts at random.  With --quick the runs have 60 actions, and then two
    tries to push the cup to a cell.
    """
    transitions, tries, name = (QUICK, 2, "quick-") if arguments.quick else (TRANSITIONS, TRIES, "")
    return [
        Condition(
            f"{name}{arrangement}-{explorer}-{perceived}".replace(" ", "-"),
            {"arrangement": arrangement, "agent": agent, "transitions": transitions, "tries": tries},
            2.0 if perceived == "replayed" else 1.0,
        )
        for arrangement, (agent, (explorer, perceived)) in product(
            list(ARRANGEMENTS)[: None if arguments.arrangements else 1], AGENTS.items()
        )
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore beside the cup, and then try to push the cup to chosen cells.

    Returns for each of the T actions whether it moved the cup, `moved` (T,), and whether the cup fell, `fell` (T,); `path`, the length of
    the cup's path in these actions [m]; `reached` (tries,), whether the cup reached the chosen cell in each try that follows plans; and,
    only for the random agent, `by_chance` (tries,), the same for tries with random actions.  `settings`: "arrangement", a key of
    ARRANGEMENTS; "agent", a key of AGENTS; numbers of "transitions" and of "tries".  `seed`: of agent and plant.
    """
    arrangement = ARRANGEMENTS[settings["arrangement"]]
    explorer, perceived = AGENTS[settings["agent"]]
    stage, count = Stage(arrangement, seed, explorer), settings["transitions"]
    if perceived == "still":
        first = stage.cup.place
        stage.source = lambda: first
    elif perceived == "replayed":
        places = iter(_places(arrangement, seed + OTHER_RUN, count))
        stage.source = lambda: next(places)
    moved, fell = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    for number in range(count):
        path, falls = stage.cup.path, stage.cup.falls
        stage.agent.step()
        fell[number] = stage.cup.falls > falls
        moved[number] = fell[number] or stage.cup.path > path + LEAST
    found = {"moved": moved, "fell": fell, "path": stage.cup.path}
    stage.source = lambda: stage.cup.place
    goals, tries = arrangement.goals, settings["tries"]
    found["reached"] = np.array(push_to(stage, goals, tries, MOST, stage.agent.model.debiased(), seed))
    if explorer == "random":
        found["by_chance"] = np.array(push_to(stage, goals, tries, MOST, None, seed))
    return found


def _places(arrangement: Arrangement, seed: int, transitions: int) -> list[Array | None]:
    """Return the true places of the cup, (3,) m in the root frame, before the first action of a curious agent and after each action.

    A place is None after the cup fell, until it is put back.  The agent perceives the cup.  `transitions`: number of actions.
    """
    stage = Stage(arrangement, seed, "curious")
    places = [stage.cup.place]
    for _ in range(transitions):
        stage.agent.step()
        places.append(stage.cup.place)
    return places


Runs = Mapping[str, list[dict[str, Any]]]  # by agent


def moves(run: Mapping[str, Any]) -> float:
    """Return the number of actions that moved the cup, per 1000 actions; `run`: result of `trial`."""
    return 1000.0 * float(run["moved"].mean())


ROW: dict[str, Callable[[Mapping[str, Any]], float]] = {
    "moves_per_1000_actions": moves,
    "of_these_the_cup_fell": lambda run: 1000.0 * float(run["fell"].mean()),
    "path_per_1000_actions_m": lambda run: 1000.0 * run["path"] / len(run["moved"]),
    "pushed_to_the_cell": lambda run: float(run["reached"].mean()),
}


def pushed(runs: Runs) -> dict[str, list[float]]:
    """Return for each choice of actions a list with the share of tries, in each run, in which the cup was pushed to the chosen cell.

    The key "AGENT, then plans" (with the name of an agent) is for tries that follow plans with the model that this agent has learned; the
    key "random actions" is for tries with random actions.
    """
    learned = {f"{agent}, then plans": group for agent, group in runs.items()}
    return of_each(learned, lambda run: float(run["reached"].mean())) | {
        RANDOM: [float(run["by_chance"].mean()) for run in runs.get(RANDOM, [])]
    }


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "agents" and "claims".

    "agents" is a dict from "arrangement: agent" to a row: "seeds", and means of the numbers in ROW; an arrangement is a set of postures of
    the hand and a grid of cells on the table.  "claims" is a list with the claims, their measured values and their verdicts, as dicts
    (`Claim.record`).  If not every agent was run in full in the first arrangement, all claims stay unmeasured and are not judged.
    """
    groups = grouped_by(found, "arrangement", "agent")
    runs = {agent: groups[MAIN, agent] for agent in AGENTS if (MAIN, agent) in groups}
    whole = len(runs) == len(AGENTS) and len(runs[CUP][0]["moved"]) == TRANSITIONS
    return {
        "agents": {f"{arrangement}: {agent}": row(group, ROW) for (arrangement, agent), group in groups.items()},
        "claims": judged(CLAIMS, runs, whole),
    }


def _more_moves(runs: Runs) -> Measured:
    values = of_each(runs, moves)
    return f"per 1000 actions: {texts(values, 0)}", stands_above(values, CUP)


def _reaches(runs: Runs) -> Measured:
    values = pushed(runs)
    judged_against = {name: values[name] for name in (f"{CUP}, then plans", f"{REPLAYED}, then plans", RANDOM)}
    return texts(values), stands_above(judged_against, f"{CUP}, then plans")


CLAIMS = (
    Claim(
        OUR_AIM,
        "a curious agent whose state holds where a cup is moves the cup more often than agents for which the cup is a ghost, at rest or "
        "with the motion of another run, and than random actions",
        "more",
        rule=_more_moves,
    ),
    Claim(
        OUR_AIM,
        "with what it has learned it pushes the cup to a chosen cell more often than random actions, and than plans learned with a "
        f"replayed ghost: share of tries with at most {MOST} actions",
        "more",
        rule=_reaches,
    ),
)


def plot(found: Cells) -> Any:
    """Draw how often the cup was moved over the number of actions, and the share of tries in which the cup got to the chosen cell.

    Returns a matplotlib figure.
    """
    groups, drawing = grouped_by(found, "arrangement", "agent"), new_figure(11.0, 4.2)
    runs = {agent: groups[MAIN, agent] for agent in AGENTS if (MAIN, agent) in groups}
    rates, shares = drawing.subplots(1, 2)
    for agent, group in runs.items():
        curves = np.array([_windows(run["moved"]) for run in group])
        width = len(group[0]["moved"]) / curves.shape[1]
        draw_curve(rates, width * (np.arange(curves.shape[1]) + 0.5), 1000.0 * curves, COLORS[agent], agent)
    finish(rates, xlabel="actions", ylabel="moves of the cup per 1000 actions", ylim=(0.0, 1.3 * rates.get_ylim()[1]))
    rates.legend(fontsize=8, loc="upper left")
    values = {name: np.array(reached) for name, reached in pushed(runs).items() if reached}
    for place, (name, reached) in enumerate(values.items()):
        draw_bars(shares, [place], [reached], 0.7, COLORS[name.removesuffix(", then plans")], name)
    shares.set_xticks(range(len(values)), [name.replace(", then", ",\nthen").replace(" a ", "\na ") for name in values], fontsize=7)
    finish(shares, ylabel=f"cup in the chosen cell within {MOST} actions", ylim=(0.0, 1.0))
    return drawing


def _windows(moved: Array) -> Array:
    """Return the share of actions that moved the cup in each of several equal parts of a run, (parts,).

    `moved` (T,): whether each action moved the cup.  A part has at least WINDOW actions, or the whole run if it is shorter.
    """
    parts = max(1, len(moved) // WINDOW)
    means: Array = np.array([part.mean() for part in np.array_split(moved, parts)])
    return means


EXPERIMENT = Experiment(
    claim="a curious agent whose state holds where a cup is moves it more often than a ghost, and pushes it to chosen cells",
    source="aim of this reproduction, to paper 3.2",
    method=Sweep(conditions, trial, findings, plot, add_options=add_options),
    claims=CLAIMS,
)
