# SPDX-License-Identifier: Apache-2.0
"""The common part of `mobee play` and `mobee learn`: the setup of robot and agents, its files, and learning offline."""
