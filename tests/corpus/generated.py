# SPDX-License-Identifier: Apache-2.0
"""Files that are made when a test needs them: too large to be committed, or readable although they are unusual."""

from __future__ import annotations

import codecs
from collections.abc import Callable

ROOT = '<ZeroPositionKinematicTree version="2.0" robotName="toy">\n'
HEAD = f'{ROOT}<bodypart name="arm"><motor name="pan" minPos="-90" maxPos="90"><joint z="1">\n'
TAIL = "\n</joint></motor></bodypart></ZeroPositionKinematicTree>\n"
PLAIN = f'{HEAD}<link x="0.2" radius="0.01"/>{TAIL}'


def around(text: str) -> bytes:
    return (HEAD + text + TAIL).encode()


def long_attribute_for_everyone() -> bytes:
    """A DTD gives every element a long attribute: 100 kB of file, gigabytes of text."""
    dtd = f'<!DOCTYPE r [<!ATTLIST link name CDATA "{"x" * 100_000}">]>\n'
    return dtd.encode() + around("<link/>" * 900)


def many(tag: str, count: int) -> Callable[[], bytes]:
    return lambda: around("\n".join(tag.format(k) for k in range(count)))


REFUSED: dict[str, tuple[Callable[[], bytes], str]] = {
    "nine megabytes of blanks": (lambda: around(" " * 9_000_000), "larger than 8 MB"),
    "nine megabytes of one name": (lambda: around(f'<link name="{"x" * 9_000_000}"/>'), "larger than 8 MB"),
    "a default attribute of 100 kB": (long_attribute_for_everyone, "more than 50000 elements or 8000000 characters"),
    "200 thousand elements": (many("<a/>", 200_000), "more than 50000 elements"),
    "nested 5000 deep": (lambda: around("<link>" * 5000 + "</link>" * 5000), "nested more than 2000 elements deep"),
    "nested 200 thousand deep": (lambda: around("<a>" * 200_000 + "</a>" * 200_000), "nested more than 2000 elements deep"),
    "2000 joints": (many('<joint name="j{}" z="1"/>', 2000), "more than 500 of this tag"),
    "3000 shapes": (
        many(
            '<link><sphere radius="1"/><box width="1" height="1" depth="1"/><capsule name="c{}" radius="1" height="1"/></link>',
            999,
        ),
        "more than 2000 shapes",
    ),
    "a megabyte as a number": (lambda: around(f'<link x="{"1" * 1_000_000}x"/>'), "is not a number"),
    "a megabyte as a link": (lambda: around(f'<ignore first="{"pam" * 300_000}" second="pan"/>'), "unknown link 'pampam"),
    "a megabyte as a motor": (lambda: around(f'<joint name="j" z="1" motor="{"pam" * 300_000}"/>'), "unknown motor 'pampam"),
    "a megabyte as a tag": (lambda: around(f'<{"link" * 250_000}/><link x="far"/>'), "'far' is not a number"),
    "800 links and the rule of 2014": (
        lambda: many('<link x="{}"/>', 800)().replace(b'"toy"', b'"toy" adjacency="published_2014"'),
        "the rule of 2014 is for at most 500 links and joints",
    ),
    "500 joints in one place and a mistake in the end": (
        lambda: many('<joint name="j{}" z="1"/>', 498)().replace(b"</bodypart>", b'</bodypart><ignore first="j1" second="nobody"/>'),
        "unknown link 'nobody'",
    ),
}

ACCEPTED: dict[str, Callable[[], bytes]] = {
    "a byte order mark": lambda: codecs.BOM_UTF8 + PLAIN.encode(),
    "UTF-16 with its mark": lambda: PLAIN.encode("utf-16"),
    "Latin-1 that says so": lambda: ('<?xml version="1.0" encoding="ISO-8859-1"?>\n' + PLAIN.replace("toy", "Köper")).encode("latin-1"),
    "line ends of Windows": lambda: PLAIN.replace("\n", "\r\n").encode(),
    "a DOCTYPE as in the thesis": lambda: b"<!DOCTYPE ZeroPositionKinematicTree>\n" + PLAIN.encode(),
    "tags in capitals": lambda: PLAIN.replace("joint", "JOINT").replace("bodypart", "BodyPart").encode(),
    "comments and processing instructions": lambda: around("<!-- <joint/> --><?editor fold?><link x='1'/>"),
    "text between the tags": lambda: around("an arm &amp; a hand <link x='1'/>"),
    "blanks around numbers": lambda: around('<link x=" 0.2 "/>'),
    "990 nested and repeated links": many('<link x="1"/>', 990),
}
