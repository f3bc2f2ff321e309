# SPDX-License-Identifier: Apache-2.0
"""`mobee keys`: makes the identities of a secured system (new, add), and lists them with the ends of their validity (list).

An identity is a private key and a certificate, for a service, another program or a person.
"""

from __future__ import annotations

import argparse
import json
import textwrap
from collections.abc import Callable
from pathlib import Path

from bus_schema.authority import AGENT, BEHAVIOURS, party_of
from bus_schema.stream import Party
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, OK
from services.common.identity import KEYS, ROUTER, BadKeys, default_folder

SERVICES = ("robot_sim", "renderer", "model", "controller", "port_filter", *BEHAVIOURS, "cup", "vision", "monitor", "recorder", "launcher")
PERSONS = ("operator", "observer")
_PARTS = ("head", "torso", "left_arm", "right_arm")  # of the iCub
_DAYS = 365

_NOTES = """actions:
  new [DIR]   make an authority and one identity for each service, for an
              operator (who may stop, release and move the robot) and for an
              observer (who may read, and stop the robot)
  add NAME..  make identities by the same authority, or renew them
  list        print all identities, and until when they are valid

Then: mobee launch --secure, mobee status --keys DIR."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee keys` to the parser: one subcommand for each action (new, add, list)."""
    parser.epilog = _NOTES
    actions = parser.add_subparsers(dest="action", required=True, metavar="|".join(_ACTIONS))
    new = actions.add_parser("new", help="make an authority and an identity for each service", description="Make a folder of keys.")
    new.add_argument("folder", nargs="?", type=Path, metavar="DIR", help=f"new or empty folder (default: {_tilde(default_folder())})")
    text = "parts of the robot that have an agent (default: those of the iCub)"
    new.add_argument("--parts", nargs="+", default=list(_PARTS), metavar="PART", help=text)
    _add_days(new)
    add = actions.add_parser("add", help="make or renew identities", description="Make identities, or renew them, by the same authority.")
    add.add_argument("names", nargs="+", metavar="NAME", help="name of a service, agent_<part>, or of a program of yours")
    text = "what a program of yours may do: client moves parts by the controller, driver in its place, observer reads (default: client)"
    add.add_argument("--as", dest="party", choices=("client", "driver", "observer", "operator"), help=text)
    _add_folder(add)
    _add_days(add)
    listed = actions.add_parser("list", help="print the identities", description="Print the identities and until when they are valid.")
    _add_folder(listed)
    listed.add_argument("--json", action="store_true", help="print as JSON")


def _add_folder(parser: argparse.ArgumentParser) -> None:
    text = f"folder of keys (default: {_tilde(default_folder())})"
    parser.add_argument("--keys", dest="folder", type=Path, metavar="DIR", help=text)


def _add_days(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--days", type=int, default=_DAYS, metavar="N", help="validity of the identities (default: %(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Run the action of `mobee keys` that the arguments name, and return the exit code."""
    folder = arguments.folder or default_folder()
    try:
        return _ACTIONS[arguments.action](folder, arguments)
    except BadKeys as error:
        raise UserError(str(error), ENVIRONMENT) from None
    except OSError as error:
        raise UserError(f"{error.filename or folder}: {error.strerror}", ENVIRONMENT) from None


def _new(folder: Path, arguments: argparse.Namespace) -> int:
    from services.common.certificates import AUTHORITY_DAYS, KeyFolder

    _check_days(arguments.days)
    names = [*SERVICES, *(f"{AGENT}{part}" for part in arguments.parts), *PERSONS]
    identities: list[tuple[str, Party | None]] = [(ROUTER, None), *((name, party_of(name)) for name in names)]
    _require_names([name for name, _ in identities])
    keys = KeyFolder.new(folder, identities, arguments.days)
    given = "" if folder == default_folder() else f" --keys {folder}"
    print(f"made {len(keys.issued())} identities in {folder}, which only you can read:")
    for kind, listed in (("services", [*SERVICES, ROUTER]), ("agents", arguments.parts), ("persons", PERSONS)):
        print(textwrap.fill(", ".join(listed), 80, initial_indent=f"  {kind + ':':<10}", subsequent_indent=" " * 12))
    print(f"They are valid for {arguments.days} days, and the authority for {AUTHORITY_DAYS // 365} years. To renew one:")
    print(f"  mobee keys add NAME{given}")
    print("Keep ca.key: who has it can make every identity. To another host take ca.crt,")
    print("and NAME.crt and NAME.key of what runs there, nothing else.")
    print("Next:")
    print(f"  mobee launch --secure{given}")
    print(f"  export {KEYS}={folder}   # then mobee status, estop, stop")
    return OK


def _add(folder: Path, arguments: argparse.Namespace) -> int:
    from services.common.certificates import KeyFolder

    _check_days(arguments.days)
    _require_names(arguments.names)
    keys = KeyFolder(folder)
    known = {one.name: one.party for one in keys.issued()}
    identities = [
        (name, known.get(name) if arguments.party is None and name in known else _party(name, arguments.party)) for name in arguments.names
    ]
    keys.add(identities, arguments.days)
    for name, party in identities:
        verb = "renewed" if name in known else "made"
        print(f"{verb} {name} ({party or ROUTER}) in {folder}, valid for {arguments.days} days")
    print("A system that runs admits new names after its next start; renewed ones at once.")
    return OK


def _party(name: str, given: Party | None) -> Party | None:
    """Return the party (role on the bus, such as "client") of a new identity; None for the router.

    `given`: party that the user has chosen; None: it follows from the name. Raises UserError if the name is that of another party, such as
    the name of a service: only a name of the party "client" can be given another party.
    """
    party = None if name == ROUTER else party_of(name)
    if given is None or given == party:
        return party
    if party != "client":
        raise UserError(
            f"{name} is the name of a service, which may do what is for {party or ROUTER}: leave --as out, or choose another name",
            BAD_INPUT,
        )
    return given


def _require_names(names: list[str]) -> None:
    """Raise UserError for the first of the names that cannot be that of an identity."""
    from services.common.certificates import require_names

    try:
        require_names(names)
    except BadKeys as error:
        raise UserError(str(error), BAD_INPUT) from None


def _check_days(days: int) -> None:
    if not 1 <= days <= 3650:
        raise UserError(f"--days {days}: give 1 to 3650 days", BAD_INPUT)


def _list(folder: Path, arguments: argparse.Namespace) -> int:
    from services.common.certificates import KeyFolder

    issued = KeyFolder(folder).issued()
    if arguments.json:
        rows = [
            {"name": one.name, "party": one.party or ROUTER, "until": one.until.isoformat(), "days_left": one.days_left()} for one in issued
        ]
        print(json.dumps(rows, indent=2))
    else:
        print(f"{'identity':<20}{'may do what is for':<20}{'valid until':<13}days left")
        for one in issued:
            end = "  expired" if one.days_left() < 0 else ""
            print(f"{one.name:<20}{one.party or ROUTER:<20}{one.until:%Y-%m-%d}   {one.days_left():>8}{end}")
    return FAILED if any(one.days_left() < 0 for one in issued) else OK


def _tilde(path: Path) -> str:
    home = Path.home()
    return f"~/{path.relative_to(home)}" if path.is_relative_to(home) else str(path)


_ACTIONS: dict[str, Callable[[Path, argparse.Namespace], int]] = {"new": _new, "add": _add, "list": _list}
