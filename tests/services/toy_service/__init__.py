# SPDX-License-Identifier: Apache-2.0
"""A service that fails on request, for the tests of its supervision."""
