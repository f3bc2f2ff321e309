# SPDX-License-Identifier: Apache-2.0
"""The experiment in which a learned agent and a planner reach for targets with the live robot; the module `claim` defines it."""
