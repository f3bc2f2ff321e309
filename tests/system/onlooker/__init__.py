# SPDX-License-Identifier: Apache-2.0
"""A service with an agent whose state holds where a cup is, by a fixed script, the same on every plant."""
