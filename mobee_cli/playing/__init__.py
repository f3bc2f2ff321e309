# SPDX-License-Identifier: Apache-2.0
"""What `mobee play` and `mobee learn` have in common: the choice of robot and agents (setup), its files, and offline learning."""
