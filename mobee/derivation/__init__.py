# SPDX-License-Identifier: Apache-2.0
"""Derives what curious agents need from any robot: arms, joints to learn, limits, home, pairs tested for contacts, and fields."""

from mobee.derivation.derive import Arm, Derived, derive

__all__ = ["Arm", "Derived", "derive"]
