# SPDX-License-Identifier: Apache-2.0
"""Small behaviours that run beside agents (thesis 9.4.2): each moves one part by what it sees."""
