# SPDX-License-Identifier: Apache-2.0
"""Derives what curious agents need from any robot: arms, the joints with which they learn, limits, home, tested pairs, and fields.

The tested pairs are the pairs of shapes that are tested for contacts; fields are volumes that cause repulsive forces.
"""

from mobee.derivation.derive import Arm, Derived, derive

__all__ = ["Arm", "Derived", "derive"]
