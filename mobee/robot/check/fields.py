"""Fields that do not do their work: a field has to be felt before the solid that it surrounds touches."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from mobee.robot.check.finding import Finding
from mobee.robot.check.subject import Subject
from mobee.robot.check.surface import outside, surface
from mobee.robot.check.words import count, length, some
from mobee.robot.robot import Shape

LEAST = 1e-3  # m: a solid that stands out less is enclosed
Link = tuple[list[Shape], list[Shape]]  # solids, fields


def fields(subject: Subject) -> Iterator[Finding]:
    """Fields inside of solids, solids that stick out of all fields of their link, links with solids and no field."""
    links: dict[tuple[int, str], Link] = defaultdict(lambda: ([], []))  # two robots may stand on one base
    for shape in subject.robot.shapes:
        links[shape.link, shape.part][shape.role == "field"].append(shape)
    if not any(fields for _, fields in links.values()):
        yield Finding(
            "note",
            "field",
            subject.where("robot", subject.robot.name),
            "the robot has no field",
            "it feels no force before its solids touch: the controller cannot keep it away from itself or from the world",
            "`mobee convert IN.urdf OUT.xml --field 0.03` gives every solid a field that reaches 3 cm farther; keep those that you want"
            if subject.is_urdf
            else 'give what shall keep away a field: field=".06" at a link, or a shape with field="true"',
        )
        return
    bare = [subject.robot.links[link] for (link, _), (solids, around) in sorted(links.items()) if solids and not around]
    if bare:
        yield Finding(
            "note",
            "field",
            subject.where("link", bare[0]),
            f"{count(bare, 'link')} with solids and without a field: {some(bare)}",
            "they touch before they feel, unless a neighbour's field always surrounds them",
            "nothing, if it is so; else give them a field",
        )
    for _, (solids, around) in sorted(links.items()):
        yield from _judge(subject, solids, around)


def _judge(subject: Subject, solids: list[Shape], around: list[Shape]) -> Iterator[Finding]:
    for field in around:
        holder = next((solid for solid in solids if outside(solid, surface(field)).max() < LEAST), None)
        if holder is not None:
            rest = any(outside(other, surface(holder)).max() < LEAST for other in around if other is not field)
            yield Finding(
                "note" if rest else "warning",  # with --field a solid inside of another has a field too
                "field",
                subject.where("shape", field.name),
                f"field {field.name!r} lies inside of solid {holder.name!r}",
                "it can never be felt before the solid touches",
                "nothing: another field surrounds that solid" if rest else "make the field larger than the solid",
            )
    if around:
        yield from _sticking(subject, solids, around)


def _sticking(subject: Subject, solids: list[Shape], around: list[Shape]) -> Iterator[Finding]:
    """The solids of one link that its fields do not enclose, the worst first."""
    out = {solid.name: float(np.min([outside(field, surface(solid)) for field in around], axis=0).max()) for solid in solids}
    names = sorted((name for name in out if out[name] >= LEAST), key=lambda name: -out[name])
    if names:
        yield Finding(
            "note",
            "field",
            subject.where("shape", names[0]),
            f"not enclosed by the fields of link {subject.robot.links[around[0].link]!r}: "
            f"{some(f'{name} stands out {length(out[name])}' for name in names)}",
            "it can touch there before a field is felt",
            f"enlarge {some((field.name for field in around), 2)}, or add a field, unless what is there needs no keeping away",
        )
