# SPDX-License-Identifier: Apache-2.0
"""Learning to reach: from which state to reach for which target, and how to get there (thesis chapter 8)."""
