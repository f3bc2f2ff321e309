# SPDX-License-Identifier: Apache-2.0
"""Compare predictors of the reward of a reach with an oracle (an agent that knows the true rewards), by the scores of the agents.

Claim: a predictor that generalises over poses and targets reaches at least .80 of an oracle's score after 200 problem-tries, .90 after 400
and .97 after 1600, and .80 after 800 on targets that were never tried; the published predictor reaches much less.
Source: the numbers are aims of this reproduction; thesis 8.5 and 9.4.4 propose "a more powerful function approximator".
Published: no numbers.
Run time: 20 minutes on 2 cores.

The arm, the targets and the evaluations are those of the experiment reach-exploration.  All learners have the same seeds, problems and
transition models.
The oracle plans as the learners do, but knows the mean reward of every reach and which transitions a target blocks.  Both are measured on
the plant by 5 tries of each reach and transition (truth.npz in the run's folder).  A score is the sum of the rewards of all targets of a
set in one evaluation.  Scores are divided by the oracle's mean score over all seeds, so that a fraction can exceed 1 by chance.  The
targets that are never tried lie in the middles of the eight cells of the grid of 27 targets.  "spread", "local" and "alike" in a learner's
name denote how it remembers failed transitions (mobee/learning/reaching/failures.py).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CELL_FILES, Cell, CellResult, load_cells
from experiments.kit.command_line import positive_number
from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, Steps, claim, judged
from experiments.kit.plots import new_figure, saved
from experiments.kit.reaching.arm import MARKER, laws, learned_beliefs, reach_plant, reach_space
from experiments.kit.reaching.learning import LEARNERS, learn, of_evaluations
from experiments.kit.reaching.targets import between, grid, targets_at
from experiments.kit.reaching.truth import TRIES, Truth, measure, oracle, truth_of
from experiments.kit.rules import decides, within
from experiments.kit.statistics import estimate, interquartile_mean, interval, ratio_estimate, ratio_interval
from experiments.kit.sweep import grouped, run_cells, sweep_arguments
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.reaches import SCALE

ORACLE, TRUTH = "oracle", "truth"
RECOMMENDED = "gp-ucb-alike"  # by docs/reaching.md
PUBLISHED = "published"
CHECKPOINTS = (100, 200, 400, 800, 1600)  # problem-tries after which the learners are evaluated
REPETITIONS = 5  # evaluations at each checkpoint

GRID, BETWEEN = "grid", "between"
AIMS = {(GRID, 200): 0.80, (GRID, 400): 0.90, (GRID, 1600): 0.97, (BETWEEN, 800): 0.80}  # set and problem-tries -> fraction of the oracle
MIN_RATIO = 2.0  # of the recommended predictor's score to the published one's
_SETS = {GRID: "on the 27 targets", BETWEEN: "on 8 targets never tried"}
TITLES = {GRID: "the 27 targets", BETWEEN: "8 targets never tried"}

Found = Mapping[str, CellResult]
Fractions = dict[tuple[str, str], Array]  # learner and set -> (seeds, checkpoints)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --seeds, --jobs, --engine, --quick, --law (control law), --scale (unit of distances, m) and --only (which learners run)."""
    sweep_arguments(parser)
    parser.add_argument("--law", choices=list(laws()), default="published", help="the control law of the arm (default: published)")
    parser.add_argument(
        "--scale", type=positive_number, default=SCALE, metavar="M", help=f"the unit of distances in the equations (default: {SCALE} m)"
    )
    parser.add_argument("--only", nargs="+", choices=list(LEARNERS), metavar="LEARNER", help=f"some of: {', '.join(LEARNERS)}")


def places(quick: bool) -> dict[str, Array]:
    """Return a dict from the set of targets ("grid": tried, "between": never tried) to their positions, (targets, 3) m, root frame.

    With `quick`, "grid" has 9 positions instead of 27, and "between" has 1 instead of 8.
    """
    return {GRID: grid()[::3] if quick else grid(), BETWEEN: between()[:1] if quick else between()}


def truths(arguments: argparse.Namespace) -> list[Cell]:
    """Return the cells (single runs) that measure the true rewards and blocked transitions, one for each target."""
    settings: dict[str, Any] = {"what": TRUTH, "law": arguments.law, "tries": 1 if arguments.quick else TRIES}
    named = {name: found.tolist() for name, found in places(arguments.quick).items()}
    return [
        Cell(f"truth-{name}-{number}", 0, settings | {"place": place})
        for name, found in named.items()
        for number, place in enumerate(found)
    ]


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Return the cells: for each seed, one run of each learner and one of the oracle.

    The oracle is an agent that knows the true rewards.  With --quick there are 200 problem-tries (attempts to reach one target) instead of
    1600.
    """
    settings: dict[str, Any] = {"law": arguments.law, "scale": arguments.scale, "quick": arguments.quick}
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    checkpoints = [100, 200] if arguments.quick else list(CHECKPOINTS)
    learners = [
        Cell(f"{name}-s{seed}", seed, settings | {"what": name, "checkpoints": checkpoints}, LEARNERS[name].cost)
        for name in arguments.only or LEARNERS
        for seed in seeds
    ]
    return learners + [Cell(f"oracle-s{seed}", seed, settings | {"what": ORACLE}, 0.2) for seed in seeds]


def measure_truth(cell: Cell) -> dict[str, Any]:
    """Measure for one target the remaining errors of reaches from all states, and which transitions the target blocks.

    `cell`: its setting "place" is the position of the target, (3,) m, root frame.  Returns `missing` (S, n) m, remaining errors of n tries
    to reach from each state, NaN for tries that were not made; and `made` and `failed` (S, A), the number of tries of each transition, and
    of those that did not end in its goal.
    """
    settings = cell.settings
    return measure(np.array(settings["place"]), settings["law"], settings["tries"]).values()


def trial(truth: Truth, cell: Cell) -> dict[str, Any]:
    """Run one learner, or the oracle with the measured `truth`, and evaluate it on both sets of targets.

    The oracle is an agent that knows the true rewards and the blocked transitions.  The sets are "grid", targets that are tried, and
    "between", targets that never are.  Returns, for L evaluations of R repetitions of P targets: `rewards_SET` (L, R, P), the rewards of
    the reaches; `states_SET` (L, R, P), the states from which they were made; `blocked_SET` (L,), the numbers of failed transitions; for a
    learner also the arrays of its tries, as in `experiments.kit.reaching.learning.learn`.
    """
    settings, space = cell.settings, reach_space()
    plant, aim = reach_plant(cell.seed, settings["law"]), laws()[settings["law"]].aim
    beliefs = learned_beliefs(plant, cell.seed)
    sets = {name: targets_at(found, aim) for name, found in places(settings["quick"]).items()}
    if settings["what"] == ORACLE:
        best = oracle(truth, space, plant, beliefs, MARKER, settings["scale"], cell.seed)
        each = (of_evaluations(name, [best.evaluate(found, 2 * REPETITIONS)]) for name, found in sets.items())
        return {key: value for one in each for key, value in one.items()}
    agent = LEARNERS[settings["what"]].agent(space, plant, beliefs, marker=MARKER, scale=settings["scale"], seed=cell.seed)
    return learn(agent, sets[GRID], settings["checkpoints"], REPETITIONS, sets)


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Run the cells that are not finished, and return the results: first the cells that measure the truth, then oracle and learners.

    The truth of all targets is written to truth.npz in the folder.
    """
    wanted = truths(arguments)
    run_cells(measure_truth, wanted, folder, arguments)
    found = load_cells(folder)
    truth = truth_of({tuple(cell.settings["place"]): found[cell.name].values for cell in wanted})
    truth.save(folder / "truth.npz")
    run_cells(partial(trial, truth), cells(arguments), folder, arguments)
    return results(folder)


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of a cell (a single run) for the raw record: only rewards are kept, added up over the targets of an evaluation.

    The raw record is an archive of the run's files in the repository.  The sums are (L, R, 1), for L evaluations of R repetitions.  The
    values of a cell that measures the truth are not changed.
    """
    rewards = {name: value for name, value in values.items() if name.startswith("rewards_")}
    return {name: value.sum(axis=-1, keepdims=True) for name, value in rewards.items()} or values


def results(folder: Path) -> dict[str, Any]:
    """Compute the results, as `findings` returns them, from all cells (each with one setting and seed) that are finished in a folder."""
    return findings(load_cells(folder))


def oracle_scores(found: Found, name: str) -> Array:
    """Return the oracle's score on a set of targets, "grid" or "between", for each seed, (seeds,): the mean of its evaluations."""
    runs = grouped(found, "what", [ORACLE]).get(ORACLE, [])
    return np.array([one[f"rewards_{name}"].sum(axis=-1).mean() for one in runs])


def fractions(found: Found) -> Fractions:
    """Return a dict from (learner, set of targets) to the scores divided by the oracle's mean score, (seeds, checkpoints).

    A checkpoint is a number of problem-tries after which the learners were evaluated (`evaluated_after`).  The sets are "grid" and
    "between".  The dict is empty without finished cells of the oracle.
    """
    curves: Fractions = {}
    for name in (GRID, BETWEEN):
        best = oracle_scores(found, name)
        for learner, runs in grouped(found, "what", list(LEARNERS)).items():
            if len(best):
                curves[learner, name] = np.array([one[f"rewards_{name}"].sum(axis=-1).mean(axis=-1) for one in runs]) / best.mean()
    return curves


def evaluated_after(found: Found) -> list[int]:
    """Return the numbers of problem-tries after which the learners were evaluated; empty if no learner has finished.

    A problem-try is one attempt to reach one target.
    """
    given = [one.cell.settings["checkpoints"] for one in found.values() if "checkpoints" in one.cell.settings]
    return list(given[0]) if given else []


def findings(found: Found) -> dict[str, Any]:
    """Return the results of all learners and of the oracle.

    Keys: "oracle's score", a dict from a set of targets to text; "fraction of the oracle's score after so many tries", a dict from
    "learner, set" to a dict from a number of tries to text; "computing seconds", a dict from the learner to a time [s]; "claims", a list
    with the judged claims, as dicts (`Claim.record`).
    """
    curves, at = fractions(found), evaluated_after(found)
    rows = {
        f"{learner}, {_SETS[name]}": {str(checkpoint): estimate(column) for checkpoint, column in zip(at, curve.T, strict=True)}
        for (learner, name), curve in curves.items()
    }
    best = {_SETS[name]: estimate(oracle_scores(found, name)) for name in (GRID, BETWEEN) if len(oracle_scores(found, name))}
    seconds = {
        learner: interquartile_mean([one.seconds for one in found.values() if one.cell.settings["what"] == learner])
        for learner in {one.cell.settings["what"] for one in found.values()}
    }
    return {
        "oracle's score": best,
        "fraction of the oracle's score after so many tries": rows,
        "computing seconds": dict(sorted(seconds.items())),
        "claims": judged(CLAIMS, (curves, at)),
    }


Evaluated = tuple[Fractions, list[int]]  # and after how many problem-tries


def _columns(found: Evaluated, name: str, checkpoint: int) -> list[Array | None]:
    """Return the score divided by the oracle's after `checkpoint` problem-tries, for the recommended and for the published predictor.

    Each is an array (seeds,), or None if there is no result for this predictor or checkpoint.  `name`: the set of targets.
    """
    curves, at = found
    known = (curves[one, name] if (one, name) in curves and checkpoint in at else None for one in (RECOMMENDED, PUBLISHED))
    return [None if curve is None else curve[:, at.index(checkpoint)] for curve in known]


def _reaches(name: str, checkpoint: int, found: Evaluated) -> Measured | None:
    ours, published = _columns(found, name, checkpoint)
    if ours is None:
        return None
    beside = "" if published is None else f"; the published predictor {estimate(published)}"
    return within(ours, least=AIMS[name, checkpoint], text=f"{RECOMMENDED} {{}}{beside}")


aimed = [
    Claim(
        OUR_AIM,
        f"after {checkpoint} problem-tries the recommended predictor reaches at least {least:.2f} of the oracle's score {_SETS[name]}",
        f"at least {least:.2f}",
        rule=partial(_reaches, name, checkpoint),
    )
    for (name, checkpoint), least in AIMS.items()
]


@claim(
    "thesis 8.5",
    "a more powerful function approximator improves the system greatly: at least twice the published predictor's score after 400 tries",
    "no numbers",
)
def improves(found: Evaluated) -> Measured | None:
    ours, published = _columns(found, GRID, 400)
    if ours is None or published is None:
        return None
    text = f"{ratio_estimate(ours, published).replace(' ', ' x ', 1)} ({RECOMMENDED} {estimate(ours)}, published {estimate(published)})"
    return text, decides(ratio_interval(ours, published), least=MIN_RATIO)


CLAIMS = (*aimed, improves)


def plot(found: Found) -> Any:
    """Draw the score of each learner, divided by the oracle's, over the number of problem-tries, a panel for each set of targets.

    The oracle is an agent that knows the true rewards.  A problem-try is one attempt to reach one target.  Crosses mark the values that we
    aim at.  Returns a matplotlib figure.  Raises InvalidValue if no learner or no oracle has finished.
    """
    curves, at = fractions(found), evaluated_after(found)
    if not curves:
        raise InvalidValue("no learner has finished, or the oracle has not: continue the run with --resume.")
    drawing = new_figure(14.0, 5.5)
    for axes, (name, title) in zip(drawing.subplots(1, 2, sharey=True), TITLES.items(), strict=True):
        for number, learner in enumerate(LEARNERS):
            if (learner, name) in curves:
                _curve(axes, at, curves[learner, name], learner, f"C{number % 10}", "--" if number >= 10 else "-")
        wanted = [(checkpoint, least) for (other, checkpoint), least in AIMS.items() if other == name]
        axes.plot(*zip(*wanted, strict=True), "kx", markersize=9.0, label="aims of this reproduction")
        axes.axhline(1.0, color="k", linestyle=":", linewidth=0.8)
        axes.set(xscale="log", xlabel="problem-tries", title=title, ylim=(0.0, None))
        axes.set_xticks(at, at)
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    drawing.axes[0].set_ylabel("fraction of the oracle's score")
    drawing.axes[1].legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return drawing


def _curve(axes: Any, at: list[int], curve: Array, learner: str, color: str, style: str) -> None:
    """Draw the interquartile mean over the seeds as a curve; for the recommended and the published learner its interval as a band, too.

    `at`: numbers of problem-tries, (L,).  `curve`: fractions of the oracle's score, (seeds, L).
    """
    middle = [interquartile_mean(column) for column in curve.T]
    axes.plot(at, middle, style, color=color, label=learner, linewidth=2.2 if learner in (RECOMMENDED, PUBLISHED) else 1.0)
    if learner in (RECOMMENDED, PUBLISHED):
        axes.fill_between(at, *np.array([interval(column) for column in curve.T]).T, color=color, alpha=0.2, linewidth=0.0)


def figure(folder: Path) -> Path:
    """Draw the finished cells in the folder of a run, and return the path of the picture."""
    return saved(plot(load_cells(folder)), folder)


EXPERIMENT = Experiment(
    claim="after a few hundred tries, predictors that generalise over poses and targets score nearly as high as an oracle",
    source="aims of this reproduction, to thesis 8.5 and 9.4.4",
    method=Steps(add_arguments, run, figure, results, CELL_FILES, summary),
    claims=CLAIMS,
)
