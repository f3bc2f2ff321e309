# SPDX-License-Identifier: Apache-2.0
"""Thesis chapters 4.1, 4.2 and 4.4: the reflex of MoBeE 1.0, which moves the robot back along its recent poses after a contact."""
