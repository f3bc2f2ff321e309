"""What touches at home, and what touches in every pose."""

from __future__ import annotations

from collections.abc import Iterator

from mobee.collision.contact import Contact
from mobee.robot.check.finding import Finding
from mobee.robot.check.subject import Subject
from mobee.robot.check.words import count, length, some
from mobee.robot.robot import Shape


def always_touching(subject: Subject) -> Iterator[Finding]:
    """Pairs that overlap in every sampled pose."""
    for first, second, kind in sorted(subject.always):
        yield Finding(
            "warning",
            "always-touching",
            subject.where("shape", first),
            f"{kind}s {first!r} and {second!r} overlap in every pose tried",
            "their contact says nothing, and hides others behind a force that never ends"
            if kind == "field"
            else "every pose counts as a collision, so no plan is ever valid",
            f"make one smaller, or leave the pair out: {_ignoring(subject, first, second)}{_written(subject) if kind == 'solid' else ''}",
        )


def _written(subject: Subject) -> str:
    """What writes the lines of a URDF's solids."""
    return " (--write-srdf writes it)" if subject.is_urdf else ""


def _ignoring(subject: Subject, first: str, second: str) -> str:
    """What leaves out the pair of links of two shapes."""
    link1, link2 = subject.urdf_link(first), subject.urdf_link(second)
    if link1 and link2:
        return f'<disable_collisions link1="{link1}" link2="{link2}" reason="Default"/> in the SRDF beside it'
    links = {shape.name: subject.robot.links[shape.link] for shape in subject.robot.shapes}
    return f'<ignore first="{links[first]}" second="{links[second]}"/>'


def home_contacts(subject: Subject) -> Iterator[Finding]:
    """Solids that collide and fields that push at home, where they do not in every pose."""
    world = subject.world.objects if subject.world else {}
    for contact in subject.at_home:
        if (contact.first, contact.second, contact.kind) in subject.always:
            continue
        pair = f"{contact.first!r} and {contact.second!r}{' of the world' if contact.second in world else ''}"
        if contact.kind == "solid":
            yield Finding(
                "error",
                "home-collision",
                subject.where("shape", contact.first),
                f"at home {pair} collide, {length(contact.depth)} deep",
                "the robot starts in a collision that it could not have moved into",
                _parting(subject, contact),
            )
        else:
            yield Finding(
                "warning",
                "home-force",
                subject.where("shape", contact.first),
                f"at home fields {pair} overlap by {length(contact.depth)}"
                if contact.second not in world
                else f"at home field {pair} overlap by {length(contact.depth)}",
                "the force pushes the robot away from its home before anything has happened",
                "make a field smaller, or move the home",
            )


def world_contacts(subject: Subject) -> Iterator[Finding]:
    """What the robot touches at home in the world, in one line; nothing without a world."""
    if subject.world is None:
        return
    world = subject.world.objects
    touched = [contact for contact in subject.at_home if contact.second in world]
    pairs = (f"{contact.kind} {contact.first!r} and {contact.second!r} ({length(contact.depth)})" for contact in touched)
    yield Finding(
        "note",
        "world",
        subject.where("robot", subject.robot.name),
        f"at home in this world of {count(world, 'object')} the robot touches {some(pairs) or 'nothing'}",
        "",
        "",
    )


def _parting(subject: Subject, contact: Contact) -> str:
    """What to do about two solids that collide at home."""
    if not subject.is_urdf:
        return "move the home, make a shape smaller, or correct where one is placed"
    remedy = 'choose a home: <group_state name="home"> in the SRDF beside it (else 0, or the nearest limit), or correct a shape'
    if contact.second_link < 0:
        return remedy
    return f"{remedy}; where only hulls of meshes overlap: {_ignoring(subject, contact.first, contact.second)}{_written(subject)}"


def foreign_solids(subject: Subject) -> Iterator[Finding]:
    """Parts whose fields reach, at home, into solids of another part whose own fields are not felt there: the deepest of each two parts."""
    deepest: dict[tuple[str, str], tuple[Shape, Shape, float]] = {}
    for field, solid, depth in subject.foreign:
        parts = field.part, solid.part
        if parts not in deepest or depth > deepest[parts][2]:
            deepest[parts] = field, solid, depth
    for (part, other), (field, solid, depth) in sorted(deepest.items()):
        yield Finding(
            "note",
            "foreign-solid",
            subject.where("shape", field.name),
            f"at home field {field.name!r} of part {part!r} reaches {length(depth)} into solid {solid.name!r} of {other!r}",
            f"fields feel fields only: {part} comes this near without a force",
            f"nothing, if the limits keep them apart; else test the fields of {subject.robot.links[solid.link]!r} against those of "
            f"{subject.robot.links[field.link]!r} (`mobee check --pairs` says why they are not)"
            if _left_out(subject, field.link, solid.link)
            else f"give the link of {solid.name!r} a field that encloses it, or make {field.name!r} smaller",
        )


def _left_out(subject: Subject, one: int, other: int) -> bool:
    """Whether both links have fields that are never tested against each other."""
    shapes, links = subject.robot.shapes, {one, other}
    bearing = {shape.link for shape in shapes if shape.role == "field"}
    return links <= bearing and not any({shapes[i].link, shapes[j].link} == links for i, j in subject.robot.field_pairs)
