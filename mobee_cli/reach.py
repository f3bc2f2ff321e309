"""`mobee reach`: put a hand on a place, on the robot that runs or offline."""

from __future__ import annotations

import argparse
import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import ActionInterrupted, MobeeError
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.record import load_reaches
from mobee.learning.reaching.store import reaching_parts
from mobee.reach import AIMS, RADIUS, ReachTarget, reward_of
from mobee.roadmap.reachable import body_at, nearest_outside, nearest_posture
from mobee.robot.robot import Robot
from mobee.store import STORE
from mobee_cli.connect import add_endpoint
from mobee_cli.errors import UserError
from mobee_cli.reach_learned import go_to_pre_reach
from mobee_cli.reach_result import ON, Result, lines
from mobee_cli.reach_stage import Choose, Hand, Stage, hand_chosen, offline
from mobee_cli.robot_options import add_robot, add_world, require_none, robot_given, robot_of_run, world_given
from services.common.exit_codes import BAD_INPUT, FAILED

_NOTES = f"""Places are in m in the robot's root frame; of the icub x backwards, y right,
z up, from the waist.
Without --run the hand is drawn there from where the robot is; with it, what the
agent of that run has learned says from which posture, and the way there.
Reached is a hand within {100 * ON:g} cm of the target's surface, when its force ends.
Exit code: 0 reached, 1 not reached, 2 bad input, 3 no system is running."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to reach for, with what, where."""
    parser.epilog = _NOTES
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--target", nargs=3, type=float, metavar=("X", "Y", "Z"), help="the place [m]")
    what.add_argument("--object", metavar="NAME", help="a target of the model's world, wherever it goes; as vision's ball")
    text = "what is put there (default: the palm nearer to the target at home; of a robot without palms its end with most motors)"
    parser.add_argument("--marker", metavar="NAME", help=text)
    parser.add_argument("--part", help="what reaches (default: the part with most motors that move the marker)")
    parser.add_argument("--radius", type=float, default=RADIUS, metavar="R", help="of the target [m] (default: %(default)g)")
    where = "where on it the marker is to come (default: the centre of a place, the surface of an object, which may be solid)"
    parser.add_argument("--aim", choices=AIMS, help=where)
    parser.add_argument("--run", type=Path, metavar="RUN", help=f"folder of a run that learned to reach, or its file {STORE}")
    parser.add_argument("--stay", action="store_true", help="stay there, instead of being drawn back")
    parser.add_argument("--offline", action="store_true", help="on the offline plant, at home")
    add_robot(parser, "offline; default: that of the run, else the icub")
    add_world(parser)
    parser.add_argument("--json", action="store_true", help="print as JSON")
    add_endpoint(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reach, and tell how it went."""
    if arguments.aim is None:
        arguments.aim = "centre" if arguments.object is None else "surface"
    try:
        with _stage(arguments) as stage:
            result = _reach(arguments, stage)
    except ActionInterrupted as interruption:
        raise UserError(f"the reach was broken off: {interruption}. `mobee status` says how the robot is.", FAILED) from None
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    print(json.dumps(result.as_json(), indent=2) if arguments.json else "\n".join(lines(result)))
    return 0 if result.reached else FAILED


def _stage(arguments: argparse.Namespace) -> AbstractContextManager[Stage]:
    if arguments.target is not None:
        ReachTarget(np.array(arguments.target), arguments.radius, arguments.aim)  # a mistake in it needs no robot
    target = arguments.object if arguments.target is None else np.array(arguments.target)
    if arguments.offline:
        if arguments.robot is None and arguments.run is not None:
            arguments.robot = robot_of_run(arguments.run)
        return offline(robot_given(arguments), world_given(arguments), _chooser(arguments), target)
    require_none(arguments, "it is for --offline; without that the robot and the world are those of the system that runs")
    from mobee_cli.reach_live import live

    return live(arguments.endpoint, _chooser(arguments), target)


def _chooser(arguments: argparse.Namespace) -> Choose:
    """What chooses the hand: the options, and of a run the part that learned."""

    def choose(robot: Robot, place: Array | None) -> Hand:
        part = arguments.part
        if part is None and arguments.run is not None and store_of(arguments.run).is_file():
            learned = reaching_parts(store_of(arguments.run))
            part = learned[0] if len(learned) == 1 else None
        return hand_chosen(robot, place, part, arguments.marker)

    return choose


def _reach(arguments: argparse.Namespace, stage: Stage) -> Result:
    part, marker, why = stage.hand.part, stage.hand.marker, stage.hand.why
    stage.robot.marker(marker)
    agent = _learned(arguments, stage)
    if agent is not None:
        if arguments.marker not in (None, agent.marker):
            raise UserError(f"{arguments.run} has learned to reach with {agent.marker!r}, not with {marker!r}", BAD_INPUT)
        marker, why = agent.marker, ""
    if arguments.object is None:
        target = ReachTarget(np.array(arguments.target), arguments.radius, arguments.aim)
        _require_outside(stage, part, marker, target.position)
        stage.plant.present(target)
    else:
        target = stage.present_object(arguments.object, arguments.aim)
        _require_outside(stage, part, marker, target.position)
    found = nearest_posture(stage.model, part, marker, target.position, stage.q())
    stage.plant.measure(part)
    way: dict[str, Any] = {}
    if agent is not None:
        way["path"], way["avoided"], way["expected"] = go_to_pre_reach(agent, target)
    outcome = stage.plant.reach(part, marker, arguments.stay)
    return Result(
        **way,
        part=part,
        marker=marker,
        why=why,
        target=target,
        outcome=outcome,
        nearest=found,
        reward=reward_of(outcome.missing),
        first_motion=stage.first_motion(),
    )


def _learned(arguments: argparse.Namespace, stage: Stage) -> ReachAgent | None:
    if arguments.run is None:
        return None
    return load_reaches(store_of(arguments.run), stage.plant, stage.hand.part)


def _require_outside(stage: Stage, part: str, marker: str, position: Array) -> None:
    model, q = stage.model, stage.q()
    link = body_at(model, part, position, q)
    if link is not None:
        free = nearest_outside(model, part, marker, position, q)
        advice = f"the nearest to which {part} can bring {marker} is about {_place(free)} m" if free is not None else "it is far from any"
        raise UserError(f"{_place(position)} m is inside the robot's own {link}: choose a place outside its body; {advice}", BAD_INPUT)


def _place(position: Array) -> str:
    return f"({', '.join(f'{x:.3g}' for x in position)})"


def store_of(run: Path) -> Path:
    """The file of a run that is given as a folder or as this file."""
    return run / STORE if run.is_dir() else run
