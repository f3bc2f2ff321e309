# SPDX-License-Identifier: Apache-2.0
"""Experiments on learning to reach (thesis chapter 8 and the claims of 4.3, 5.3 and 9), compared with planners."""
