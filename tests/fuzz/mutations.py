# SPDX-License-Identifier: Apache-2.0
"""Seeded changes to the structure of an XML file: what bit flips would need years to find."""

from __future__ import annotations

import random
import re

ELEMENT = re.compile(r"<[^<>!?][^<>]*>")
ATTRIBUTE = re.compile(r'([\w:]+)\s*=\s*"([^"]*)"')
NUMBERS = (
    "0",
    "-1",
    "1e-300",
    "1e300",
    "1e19",
    "nan",
    "inf",
    "0x1p3",
    "1_0",
    "٣",
    "",
    " ",
    "1e-9",
    "-0",
    "1 2 3",
    "0 0 0",
    "7",
    ".5.",
    "²",
)
TEXTS = (
    "true",
    "maybe",
    "base",
    "pan",
    "katana",
    "icub",
    ".",
    "..",
    "/dev/zero",
    "a\u0301",
    "x" * 300,
    "&amp;",
    "'",
    "%s",
    "{}",
    "../" * 20,
)


def mutated(text: str, rng: random.Random, names: list[str]) -> str:
    """The text with one to four changes; `names`: tags and attributes that may be written in."""
    for _ in range(rng.randint(1, 4)):
        text = rng.choice(CHANGES)(text, rng, names)
    return text


def _span(text: str, rng: random.Random, pattern: re.Pattern[str]) -> re.Match[str] | None:
    found = list(pattern.finditer(text))
    return rng.choice(found) if found else None


def _replace(text: str, match: re.Match[str] | None, new: str) -> str:
    return text if match is None else text[: match.start()] + new + text[match.end() :]


def _value(text: str, rng: random.Random, names: list[str]) -> str:
    match = _span(text, rng, ATTRIBUTE)
    values = [value for _, value in ATTRIBUTE.findall(text)] or [""]
    new = rng.choice((rng.choice(NUMBERS), rng.choice(TEXTS), rng.choice(values)))
    return _replace(text, match, f'{match[1]}="{new}"') if match else text


def _attribute_name(text: str, rng: random.Random, names: list[str]) -> str:
    match = _span(text, rng, ATTRIBUTE)
    return _replace(text, match, f'{rng.choice(names)}="{match[2]}"') if match else text


def _no_attribute(text: str, rng: random.Random, names: list[str]) -> str:
    return _replace(text, _span(text, rng, ATTRIBUTE), "")


def _more_attributes(text: str, rng: random.Random, names: list[str]) -> str:
    match = _span(text, rng, ATTRIBUTE)
    return _replace(text, match, f'{match[0]} {rng.choice(names)}="{rng.choice(NUMBERS + TEXTS)}"') if match else text


def _no_element(text: str, rng: random.Random, names: list[str]) -> str:
    return _replace(text, _span(text, rng, ELEMENT), "")


def _more_elements(text: str, rng: random.Random, names: list[str]) -> str:
    match, other = _span(text, rng, ELEMENT), _span(text, rng, ELEMENT)
    return _replace(text, match, match[0] + other[0]) if match and other else text


def _copy_of_a_branch(text: str, rng: random.Random, names: list[str]) -> str:
    match, place = _span(text, rng, ELEMENT), _span(text, rng, ELEMENT)
    if match is None or place is None or match[0].startswith("</"):
        return text
    tag = re.match(r"<\s*([\w:]+)", match[0])
    end = text.find(f"</{tag[1]}>", match.end()) if tag and not match[0].endswith("/>") else -1
    branch = match[0] if end < 0 else text[match.start() : end] + f"</{tag[1] if tag else ''}>"
    return _replace(text, place, place[0] + branch)


def _tag(text: str, rng: random.Random, names: list[str]) -> str:
    tags = re.findall(r"<\s*([\w:]+)", text)
    return re.sub(rf"(?<=[</]){re.escape(rng.choice(tags))}\b", rng.choice(names), text, count=rng.choice((1, 2, 0))) if tags else text


def _cut(text: str, rng: random.Random, names: list[str]) -> str:
    start = rng.randrange(len(text) + 1)
    return text[:start] + (text[start + rng.randint(1, 200) :] if rng.random() < 0.7 else "")


CHANGES = (
    *(_value,) * 4,
    _attribute_name,
    _no_attribute,
    _more_attributes,
    _no_element,
    _more_elements,
    *(_copy_of_a_branch,) * 2,
    _tag,
    _cut,
)
