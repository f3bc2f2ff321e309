# SPDX-License-Identifier: Apache-2.0
"""The cup on the table: scenes by seed, what the cameras see of them, and three planners of paths to the pre-grasp (thesis 4.3.3)."""
