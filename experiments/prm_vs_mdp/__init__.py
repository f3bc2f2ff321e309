"""A roadmap planner and the learned MDP planner on the same noisy robot, which neither of them knows whole.

Claim: "a plan first, act later approach, such as PRM planning, will never work well on robots such as the iCub", and the roadmap's
"simple graph is insufficient", an MDP is needed.  Source: paper 2.3, 3.1 (the comparison it says the experiment offers); thesis 4.2.
Published: no numbers.  Run time: four minutes on 2 cores.

The left arm of the published robot among four balls; 60 queries from rest to a cell of the rank 3 lattice, half of them not reached by
going straight, at most 120 s each.  The roadmaps' belief about the robot lacks the shoulder's cables, or has the balls 1 cm and
the joints 3 degrees off, or both; the MDP believes nothing and learns by curiosity before the queries, or from the queries alone.
A roadmap falls short if, where going straight fails, it succeeds in less than 95 % and less often than the MDP.  The seeds draw balls,
noise and queries; the lattice's graph is the same for all.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import arm_plant
from experiments.kit.cells import Cell, load_cells
from experiments.kit.claims import Claim
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.prm_vs_mdp.belief import BELIEFS, believed
from experiments.prm_vs_mdp.figure import draw
from experiments.prm_vs_mdp.graphs import KINDS, NEIGHBOURS, make_roadmap, with_goals
from experiments.prm_vs_mdp.ompl_roadmap import require_ompl
from experiments.prm_vs_mdp.queries import answer
from experiments.prm_vs_mdp.rivals import Learned, PlannedOnce, Repaired, Rival, Straight
from experiments.prm_vs_mdp.scene import Scene, make_scene, space, world_of
from experiments.prm_vs_mdp.summary import Row, Summary, summarise
from mobee import CuriousAgent, Lattice

NAME = "prm-vs-mdp"
CLAIM = "a roadmap that is planned first and followed later does not work on a noisy robot, and a learned MDP is needed"
SOURCE = "paper 2.3, 3.1; thesis 4.2"
CLAIMS = (
    Claim("paper 3.1", "a plan first, act later approach, such as a PRM, does not work well: plans fail at run time", "no number"),
    Claim("paper 2.3", "the PRM's simple graph is insufficient: with part of the truth hidden, a learned MDP is needed", "no number"),
)
LEARNED = (0, 1000, 4000)  # transitions before the first query
QUERIES = 60
WELL = 0.95  # success, also where going straight fails, of what "works well"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Of each seed: going straight, the MDP after so many transitions, the roadmaps under each belief."""
    queries = 20 if arguments.quick else QUERIES
    found = []
    for seed in range(arguments.seed, arguments.seed + arguments.seeds):
        found.append(Cell(f"straight-s{seed}", seed, {"queries": queries}, 1.0))
        found += [Cell(f"mdp-{n}-s{seed}", seed, {"queries": queries, "learned": n}, 1.0 + n / 1000) for n in LEARNED]
        found += [Cell(f"roadmaps-{b.replace(' ', '-')}-s{seed}", seed, {"queries": queries, "belief": b}, 8.0) for b in BELIEFS]
    return found


def work(cell: Cell) -> dict[str, Any]:
    """Send the rivals of a cell to all goals; arrays by "rival|measure"."""
    scene, lattice = make_scene(cell.seed, cell.settings["queries"]), space()
    values: dict[str, Any] = {"hard": scene.is_hard}
    for name, rival, price in _rivals(cell, scene, lattice):
        got = answer(scene, rival, cell.seed)
        for measure in ("success", "seconds", "actions", "repairs"):
            values[f"{name}|{measure}"] = np.asarray(getattr(got, measure))
        values[f"{name}|price"] = np.array(price)
    return values


def _rivals(cell: Cell, scene: Scene, lattice: Lattice) -> Iterator[tuple[str, Rival, float]]:
    """Each with its name and its price: hours of plant time, or thousands of poses looked at, before the first query."""
    settings = cell.settings
    if "learned" in settings:
        plant = arm_plant(cell.seed + 500, world=world_of(scene.balls))
        agent = CuriousAgent(lattice, plant, seed=cell.seed)
        agent.run(settings["learned"])
        yield f"MDP, {settings['learned']} learned", Learned(lattice, agent.model), plant.time / 3600.0
    elif "belief" in settings:
        belief = believed(scene, settings["belief"])
        for kind in KINDS:
            before = belief.looks
            roadmap = make_roadmap(kind, belief, lattice, cell.seed)
            vertex_of = with_goals(roadmap, lattice, scene.goals)
            looks = (belief.looks - before) / 1000.0
            yield f"{kind}, planned once", PlannedOnce(roadmap, vertex_of, NEIGHBOURS), looks
            for remembers in (False, True):
                yield f"{kind}, {'remembers' if remembers else 'repairs'}", Repaired(roadmap, vertex_of, NEIGHBOURS, remembers), looks
    else:
        yield "straight", Straight(lattice), 0.0


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Work off all cells; returns the table and the claims.  Raises OmplMissing before anything is begun."""
    require_ompl()
    run_cells(work, cells(arguments), folder, arguments)
    summary = summarise(load_cells(folder).values())
    return {"claims": [claim.record() for claim in _claims(summary)], "rivals": summary.table()}


def _claims(summary: Summary) -> list[Claim]:
    once, learned = summary.row("OMPL, planned once", "both"), summary.row("MDP, 4000 learned", "")
    remembers = summary.row("OMPL, remembers", "both")
    a_query = 3600.0 * learned.price / QUERIES
    first = CLAIMS[0].measured(
        f"with cables, 1 cm and 3 degrees hidden, success {once.success}, {once.hard} where going straight fails;"
        f" the MDP after 4000 transitions {learned.success}, {learned.hard}",
        _falls_short(once, learned),
    )
    second = CLAIMS[1].measured(
        f"a PRM that takes out what fails, and remembers it, succeeds in {remembers.success}, {remembers.hard} where going straight fails,"
        f" and takes {remembers.seconds} s a query; the MDP {learned.success}, {learned.hard} and {learned.seconds} s, after"
        f" {learned.price:.1f} h of learning, {a_query:.0f} s for each of {QUERIES} queries",
        _falls_short(remembers, learned),
    )
    return [first, second]


def _falls_short(roadmap: Row, learned: Row) -> bool | None:
    """Whether the roadmap does not work well where going straight fails, and the MDP does better; False where it works well."""
    if roadmap.hard.high < min(WELL, learned.hard.low):
        return True
    return False if roadmap.hard.low >= WELL else None


def figure(folder: Path) -> Path:
    """Success and time of all rivals, and how time falls with the number of queries."""
    return draw(summarise(load_cells(folder).values()), folder / "prm-vs-mdp.png")
