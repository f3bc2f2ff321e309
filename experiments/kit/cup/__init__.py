# SPDX-License-Identifier: Apache-2.0
"""The cup on the table: scenes by seed, what is seen of them, and three planners of a path to the pre-grasp beside it (thesis 4.3.3)."""
