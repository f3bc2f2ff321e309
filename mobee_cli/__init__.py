# SPDX-License-Identifier: Apache-2.0
"""The command `mobee`: one file per verb."""
