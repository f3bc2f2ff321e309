# SPDX-License-Identifier: Apache-2.0
"""A service that acts and reaches by a fixed script, the same on every plant."""
