# SPDX-License-Identifier: Apache-2.0
"""`mobee reach`: moves a hand to a position or an object, with the running robot or offline."""

from __future__ import annotations

import argparse
import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.control.reach import marker_error
from mobee.errors import ActionInterrupted, MobeeError
from mobee.learning.reaching.failures import has_failed
from mobee.learning.reaching.reach_agent import ReachAgent, move
from mobee.learning.reaching.record import load_reaches
from mobee.learning.reaching.store import reaching_parts
from mobee.reach import AIMS, RADIUS, ReachTarget, reward_of
from mobee.roadmap.ik.solve import body_at, nearest_outside, nearest_posture
from mobee.robot.robot import Robot
from mobee.store import STORE
from mobee_cli.connect import add_endpoint
from mobee_cli.errors import UserError
from mobee_cli.reach_result import REACHED_DISTANCE, Result, lines
from mobee_cli.reach_setup import Choose, Hand, Setup, choose_hand, offline
from mobee_cli.robot_options import add_robot, add_world, require_none, robot_given, robot_of_run, world_given
from services.common.exit_codes import BAD_INPUT, FAILED

_NOTES = f"""Positions are in m in the robot's root frame; for the icub x points backwards,
y right, z up, and the origin is at the waist.
Without --run a force pulls the hand from the present posture. With --run the
robot first moves to the posture from which the agent of that run expects the
largest reward. The target is reached if the hand ends within {100 * REACHED_DISTANCE:g} cm of its
surface.
Exit code: 0 reached, 1 not reached, 2 bad input, 3 no system is running."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee reach` to the parser: target, hand, robot and others."""
    parser.epilog = _NOTES
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--target", nargs=3, type=float, metavar=("X", "Y", "Z"), help="position of the target [m]")
    what.add_argument("--object", metavar="NAME", help="a target object of the model's world, such as the ball of vision")
    text = "marker that reaches (default: the palm nearer to the target at home; without palms, the end that the most motors move)"
    parser.add_argument("--marker", metavar="NAME", help=text)
    parser.add_argument("--part", help="part that reaches (default: the part with the most motors that move the marker)")
    parser.add_argument("--radius", type=float, metavar="R", help=f"radius of the target of --target [m] (default: {RADIUS:g})")
    where = (
        "bring the marker to the centre or to the surface of the target (default: centre for --target, surface for --object and --facing)"
    )
    parser.add_argument("--aim", choices=AIMS, help=where)
    parser.add_argument("--facing", action="store_true", help="turn the marker's normal, such as that of a palm, towards the target")
    parser.add_argument("--run", type=Path, metavar="RUN", help=f"folder of a run that has learned to reach, or its file {STORE}")
    parser.add_argument("--stay", action="store_true", help="stay at the target; without it the hand moves back")
    parser.add_argument("--offline", action="store_true", help="use the offline plant, starting at home, instead of the running system")
    add_robot(parser, "offline only; default: the robot of the run, else icub")
    add_world(parser)
    parser.add_argument("--json", action="store_true", help="print as JSON")
    add_endpoint(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee reach`: reach for the target, print the result, and return the exit code (0: reached, 1: not reached)."""
    if arguments.aim is None:
        arguments.aim = "surface" if arguments.object is not None or arguments.facing else "centre"
    if arguments.object is not None and arguments.radius is not None:
        raise UserError(f"--radius {arguments.radius:g}: only valid with --target; an object has its own radius", BAD_INPUT)
    arguments.radius = RADIUS if arguments.radius is None else arguments.radius
    try:
        with _setup(arguments) as setup:
            result = _reach(arguments, setup)
    except ActionInterrupted as interruption:
        raise UserError(f"the reach was interrupted: {interruption}. `mobee status` shows the state of the robot.", FAILED) from None
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    print(json.dumps(result.as_json(), indent=2) if arguments.json else "\n".join(lines(result)))
    return 0 if result.reached else FAILED


def _setup(arguments: argparse.Namespace) -> AbstractContextManager[Setup]:
    if arguments.target is not None:
        ReachTarget(np.array(arguments.target), arguments.radius, arguments.aim)  # raises for a bad value before a robot is loaded
    target = arguments.object if arguments.target is None else np.array(arguments.target)
    if arguments.offline:
        if arguments.robot is None and arguments.run is not None:
            arguments.robot = robot_of_run(arguments.run)
        return offline(robot_given(arguments), world_given(arguments), _chooser(arguments), target)
    require_none(arguments, "only valid with --offline; without it the robot and the world are those of the running system")
    from mobee_cli.reach_live import live

    return live(arguments.endpoint, _chooser(arguments), target)


def _chooser(arguments: argparse.Namespace) -> Choose:
    """Return a function that chooses the part and the marker that reach for the target, from the options of the command.

    If the options name no part, and the given run has one part that has learned to reach, this part is chosen.
    """

    def choose(robot: Robot, position: Array | None) -> Hand:
        part = arguments.part
        if part is None and arguments.run is not None and store_of(arguments.run).is_file():
            learned = reaching_parts(store_of(arguments.run))
            part = learned[0] if len(learned) == 1 else None
        return choose_hand(robot, position, part, arguments.marker)

    return choose


def _reach(arguments: argparse.Namespace, setup: Setup) -> Result:
    part, marker, why = setup.hand.part, setup.hand.marker, setup.hand.why
    setup.robot.marker(marker)
    agent = _learned(arguments, setup)
    if agent is not None:
        if arguments.marker not in (None, agent.marker):
            raise UserError(f"{arguments.run} has learned to reach with {agent.marker!r}, not with {marker!r}", BAD_INPUT)
        marker, why = agent.marker, ""
    if arguments.object is None:
        target = ReachTarget(np.array(arguments.target), arguments.radius, arguments.aim, faces=arguments.facing)
        _require_outside(setup, part, marker, target.position)
        setup.plant.present(target)
    else:
        target = setup.present_object(arguments.object, arguments.aim, arguments.facing)
        _require_outside(setup, part, marker, target.position)
    found = nearest_posture(setup.model, part, marker, target.position, setup.q())
    setup.plant.measure(part)
    learned: dict[str, Any] = {}
    if agent is not None:
        learned["path"], learned["avoided"], learned["expected"] = go_to_pre_reach(agent, target)
    q = setup.q()
    outcome = setup.plant.reach(part, marker, arguments.stay)
    q[setup.robot.part(part).slice] = outcome.q
    return Result(
        **learned,
        part=part,
        marker=marker,
        why=why,
        target=target,
        outcome=outcome,
        angle=marker_error(setup.model, marker, target, q).angle if arguments.facing else None,
        nearest=found,
        reward=reward_of(outcome.missing),
        first_motion=setup.first_motion(),
    )


def _learned(arguments: argparse.Namespace, setup: Setup) -> ReachAgent | None:
    if arguments.run is None:
        return None
    return load_reaches(store_of(arguments.run), setup.plant, setup.hand.part)


def _require_outside(setup: Setup, part: str, marker: str, position: Array) -> None:
    model, q = setup.model, setup.q()
    link = body_at(model, part, position, q)
    if link is not None:
        free = nearest_outside(model, part, marker, position, q)
        advice = "none is near" if free is None else f"the nearest to which {part} can bring {marker} is about {_place(free)} m"
        raise UserError(f"{_place(position)} m is inside the robot's own {link}: choose a place outside its body; {advice}", BAD_INPUT)


def _place(position: Array) -> str:
    return f"({', '.join(f'{x:.3g}' for x in position)})"


def store_of(run: Path) -> Path:
    """Return the path of a run's SQLite file of transitions and reaches. `run`: folder of the run, or the path of the file itself."""
    return run / STORE if run.is_dir() else run


def go_to_pre_reach(agent: ReachAgent, target: ReachTarget) -> tuple[tuple[int, ...], tuple[tuple[int, int], ...], float]:
    """Move to the state from which the agent expects the largest reward of a reach for the target.

    After each transition the agent plans again. It remembers transitions that have failed, and plans around them.

    Returns:
        The states of the path, the transitions (state, goal) that the plans avoided, and the reward expected in the last state.
    """
    state = agent.state
    path, avoided = [state], dict[tuple[int, int], None]()
    for _ in range(agent.limit - 1):
        plan = agent.plan(target, state)
        avoided.update(dict.fromkeys(plan.avoided))
        if not plan.actions:
            break
        expected = np.maximum(agent.predictor.mean(target.position), 0.0)
        values, _ = agent.planning.values(expected, agent.failures.rewards(target.position, float(expected.max())))
        action = plan.actions[0]
        _, following = move(agent.plant, agent.space, state, action)
        if has_failed(values, state, following):
            agent.failures.add(state, action, target.position, agent.penalty)
        state = following
        path.append(state)
    return tuple(path), tuple(avoided), float(agent.predictor.mean(target.position)[state])
