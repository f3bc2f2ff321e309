# SPDX-License-Identifier: Apache-2.0
"""The reference pages of the site: public names by their docstrings, the command by its parsers."""

from __future__ import annotations

import argparse
import importlib
import os
import pkgutil

TITLES = {
    "robot": "Robots",
    "model": "Model and world",
    "control": "Control",
    "plant": "Plants",
    "learning": "Learning",
    "reach": "Reaching",
    "roadmap": "Roadmaps",
    "check": "Checks of files",
    "errors": "Errors",
}
"""The page of a public name, by the folder or file of `mobee` that defines it; any other has a page of its own name."""

SAME_PAGE = {"simulation": "plant"}


def pages() -> dict[str, str]:
    """The text of each reference page, by its path in the repository."""
    groups = _groups()
    made = {f"docs/api/{name}.md": _names_page(TITLES.get(name, name), names) for name, names in groups.items()}
    made["docs/api/bus_schema.md"] = _bus_page()
    made["docs/api/index.md"] = _index_page(groups)
    made["docs/api/command.md"] = _command_page()
    return made


def _groups() -> dict[str, list[str]]:
    """The public names of `mobee` by page, in the order of TITLES."""
    import mobee

    groups: dict[str, list[str]] = {name: [] for name in TITLES}
    for name in mobee.__all__:
        module = mobee._HOME[name].split(".")
        folder = "reach" if "reaching" in module else module[1]
        groups.setdefault(SAME_PAGE.get(folder, folder), []).append(f"mobee.{name}")
    groups["check"] = [f"mobee.check.{name}" for name in importlib.import_module("mobee.check").__all__]
    return {name: names for name, names in groups.items() if names}


def _names_page(title: str, names: list[str]) -> str:
    ordered = sorted(names, key=lambda name: (not name.split(".")[-1][0].isupper(), name.lower()))  # classes first
    return f"# {title}\n\n" + "\n".join(f"## {name}\n\n" + _directive(name) for name in ordered)


def _directive(name: str) -> str:
    module, _, attribute = name.rpartition(".")
    value = getattr(importlib.import_module(module), attribute)
    kind = "class" if isinstance(value, type) else "function" if callable(value) else "module"
    return f"```{{eval-rst}}\n.. auto{kind}:: {value.__name__ if kind == 'module' else name}\n```\n"


def _bus_page() -> str:
    text = "# bus_schema\n\nThe messages of the bus, field by field; [the bus](../bus.md) says who publishes and reads them.\n"
    for name in sorted(module.name for module in pkgutil.iter_modules(importlib.import_module("bus_schema").__path__)):
        text += f"\n## bus_schema.{name}\n\n```{{eval-rst}}\n.. automodule:: bus_schema.{name}\n   :undoc-members:\n```\n"
    return text


def _index_page(groups: dict[str, list[str]]) -> str:
    """The list of all names, with the pages below it."""
    rows = [f"| [{TITLES.get(name, name)}]({name}.md) | {', '.join(f'`{one}`' for one in names)} |" for name, names in groups.items()]
    listed = "\n".join(("```{toctree}", ":hidden:", ":titlesonly:", "", *groups, "bus_schema", "```"))
    return "\n".join(
        ("# Public names", "", "| page | names |", "|---|---|", *rows, "| [bus](bus_schema.md) | messages and keys |", "", listed, "")
    )


def _command_page() -> str:
    """The help of each verb, and of each action of a verb that has several."""
    from mobee_cli.__main__ import VERBS, parser_of

    os.environ["COLUMNS"] = "110"
    text = (
        "# Options of the command\n\nWhat `mobee VERB --help` prints. [The command `mobee`](../commands.md) says what each verb is for.\n"
    )
    for verb in VERBS:
        text += _help(parser_of(verb), 2)
    return text


def _help(parser: argparse.ArgumentParser, level: int) -> str:
    text = f"\n{'#' * level} {parser.prog}\n\n```text\n{parser.format_help().rstrip()}\n```\n"
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            text += "".join(_help(one, level + 1) for one in dict.fromkeys(action.choices.values()))
    return text
