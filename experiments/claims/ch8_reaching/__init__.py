# SPDX-License-Identifier: Apache-2.0
"""Thesis chapter 8, and what it promises in 4.3, 5.3 and 9: learning to reach, beside planners."""
