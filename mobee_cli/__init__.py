# SPDX-License-Identifier: Apache-2.0
"""The command `mobee`: one module or package per verb (first argument)."""
