# SPDX-License-Identifier: Apache-2.0
"""The version of the contract: a receiver refuses every other one."""

VERSION = 4
