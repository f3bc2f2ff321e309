"""Markers that no motor moves."""

from __future__ import annotations

from collections.abc import Iterator

from mobee.robot.check.finding import Finding
from mobee.robot.check.subject import Subject
from mobee.robot.check.words import count, some


def unreachable_markers(subject: Subject) -> Iterator[Finding]:
    """Markers on links that stay where they are, whatever the motors do; one note of all in a URDF, where every link is a marker."""
    unmoved = [marker for marker in subject.robot.markers.values() if marker.link not in subject.moved]
    if subject.is_urdf and unmoved:
        yield Finding(
            "note",
            "marker",
            subject.where("marker", unmoved[0].name),
            f"{count(unmoved, 'marker')} that no motor moves: {some(marker.name for marker in unmoved)}",
            "their Jacobian is zero: they can neither be reached with nor be pushed",
            "nothing, if they are frames of the base",
        )
        return
    for marker in unmoved:
        yield Finding(
            "warning",
            "marker",
            subject.where("marker", marker.name),
            f"no motor moves marker {marker.name!r}: it sits on link {subject.robot.links[marker.link]!r}",
            "its Jacobian is zero: it can neither be reached with nor be pushed",
            "write it inside the joint that should carry it",
        )
