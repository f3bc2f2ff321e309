# SPDX-License-Identifier: Apache-2.0
"""Adaptive roadmaps (thesis 4.2, 4.3, 9.4.5)."""
