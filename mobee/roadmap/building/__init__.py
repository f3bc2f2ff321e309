# SPDX-License-Identifier: Apache-2.0
"""Task-relevant roadmaps: task spaces, and builders by evolution strategy and by least squares on a lattice (thesis 3.3)."""
