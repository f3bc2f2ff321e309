# SPDX-License-Identifier: Apache-2.0
"""Poses from costs: natural gradient inverse kinematics (thesis 3.2)."""
