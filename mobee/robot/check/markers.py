"""Markers that no motor moves."""

from __future__ import annotations

from collections.abc import Iterator

from mobee.robot.check.finding import Finding
from mobee.robot.check.subject import Subject


def unreachable_markers(subject: Subject) -> Iterator[Finding]:
    """Markers on links that stay where they are, whatever the motors do."""
    for marker in subject.robot.markers.values():
        if marker.link in subject.moved:
            continue
        yield Finding(
            "warning",
            "marker",
            subject.where("marker", marker.name),
            f"no motor moves marker {marker.name!r}: it sits on link {subject.robot.links[marker.link]!r}",
            "its Jacobian is zero: it can neither be reached with nor be pushed",
            "write it inside the joint that should carry it",
        )
