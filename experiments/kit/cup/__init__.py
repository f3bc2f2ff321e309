# SPDX-License-Identifier: Apache-2.0
"""The cup on the table: random scenes, what the cameras see of them, and three methods to reach the pre-grasp (thesis 4.3.3)."""
