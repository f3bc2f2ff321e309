# SPDX-License-Identifier: Apache-2.0
"""Learning to reach: the state from which to reach for each target, and a path to this state (thesis chapter 8)."""
