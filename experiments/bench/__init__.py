# SPDX-License-Identifier: Apache-2.0
"""The benchmarks of `mobee bench`, one module each, and the programs with which they compare MoBeE."""
