# SPDX-License-Identifier: Apache-2.0
"""`mobee detector train`: trains a detector of the objects (things) of a world on rendered pictures, and writes it as ONNX."""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

from experiments.kit.command_line import Progress, positive_whole
from mobee.errors import MobeeError, NotInstalled
from mobee.vision.objects.detection import by_color
from mobee.vision.objects.detectors import by_network
from mobee.vision.objects.learned.network import SUFFIX, Network
from mobee.vision.objects.learned.training import PICTURES, Quality, held_out, judge, train
from mobee.vision.objects.thing import things_in
from mobee_cli.errors import UserError
from mobee_cli.robot_options import DEFAULT, add_urdf_options, robot_given, world_given
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT

WORLD = "things"
_DESCRIPTION = "train a detector on rendered pictures of the targets of a world"
_NOTES = """The targets of the world that have a colour are drawn at random places, in
random rooms with paper of their colours. A small convolutional network learns
how much of each pixel shows each of them, and is judged on other pictures.
FILE holds the network and the things; the vision service uses it:
  mobee detector train things.onnx
  mobee launch eyes --set shared.world=things \\
    --set services.vision.detector=things.onnx"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee detector` to the parser: its only action, train."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="train")
    one = actions.add_parser(
        "train", help=_DESCRIPTION, description=_DESCRIPTION, epilog=_NOTES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    one.add_argument("file", type=Path, metavar="FILE", help=f"file of the network; its name ends in {SUFFIX}")
    one.add_argument("--world", default=WORLD, metavar="FILE", help="shipped world, or path of a .xml file (default: %(default)s)")
    one.add_argument("--robot", metavar="FILE", help=f"shipped robot, or path of a .xml or .urdf file (default: {DEFAULT})")
    add_urdf_options(one)
    one.add_argument("--pictures", type=positive_whole, default=PICTURES, metavar="N", help="pictures to learn from (default: %(default)s)")
    one.add_argument("--seed", type=int, default=0, metavar="N", help="of pictures and weights (default: 0)")
    one.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee detector train`: train the detector, save it, print its quality, and return the exit code."""
    file: Path = arguments.file
    if file.suffix != SUFFIX:
        raise UserError(f"{file}: its name must end in {SUFFIX}", BAD_INPUT)
    if arguments.seed < 0:
        raise UserError(f"--seed {arguments.seed}: must be 0 or more", BAD_INPUT)
    if not os.access(file.parent, os.W_OK):  # before the training, which takes a minute
        raise UserError(f"{file}: cannot be written: {file.parent} is no folder in which you may write", BAD_INPUT)
    begin = perf_counter()
    try:
        robot, world = robot_given(arguments), world_given(arguments)
        things = things_in(world)
        if not things:
            raise UserError(f"world {arguments.world}: it has no target with a colour; give another one with --world", BAD_INPUT)
        with Progress() as progress:
            settings = robot, world, things, arguments.pictures, arguments.seed
            network = train(*settings, lambda share, text: progress.show(0.9 * share, text))
            progress.show(0.9, "looking at other pictures")
            pictures, names = list(held_out(*settings)), [one.name for one in things]
            found = {
                name: judge(of, names, pictures) for name, of in (("learned", by_network(network, things)), ("by colour", by_color(things)))
            }
        network.save(file)
    except NotInstalled as error:
        raise UserError(str(error), ENVIRONMENT) from None
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    except OSError as error:
        raise UserError(f"{file}: cannot be written ({error.strerror})", BAD_INPUT) from None
    seconds = perf_counter() - begin
    if arguments.json:
        plain = {"file": str(file), "things": [asdict(one) for one in network.things], "pictures": arguments.pictures, "seconds": seconds}
        print(json.dumps(plain | {"held_out": {name: asdict(one) for name, one in found.items()}}, indent=2))
    else:
        print("\n".join(_lines(network, found, arguments.pictures, seconds, file)))
    return 0


def _lines(network: Network, found: dict[str, Quality], pictures: int, seconds: float, file: Path) -> list[str]:
    """Return the report on the trained network as lines of text: the quality on pictures that were not used to train it."""
    some = list(found.values())
    rows = [(f"{one.name} found, share of those wholly visible", [f"{by.found[one.name]:.2f}" for by in some]) for one in network.things]
    rows += [
        ("error of the middle, median, px", [f"{by.error:.2f}" for by in some]),
        ("false regions a picture", [f"{by.false_regions:.2f}" for by in some]),
        ("processor time a picture, ms", [f"{1e3 * by.seconds:.1f}" for by in some]),
    ]
    return [
        f"{pictures} pictures of {', '.join(one.name for one in network.things)}; {seconds:.0f} s",
        f"{f'on {some[0].pictures} others:':<50}{''.join(f'{name:>12}' for name in found)}",
        *(f"{text:<50}{''.join(f'{value:>12}' for value in values)}" for text, values in rows),
        f"saved in {file}",
    ]
