# SPDX-License-Identifier: Apache-2.0
"""Adaptive roadmaps, whose edges count as free until a motion along them has failed (thesis 4.2, 4.3, 9.4.5)."""
