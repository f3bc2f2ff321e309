# SPDX-License-Identifier: Apache-2.0
"""Common code of the experiments: sweeps, statistics, figures, records and live runs."""
