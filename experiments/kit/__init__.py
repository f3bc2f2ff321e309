# SPDX-License-Identifier: Apache-2.0
"""What experiments share: sweeps, statistics, figures, records, live runs."""
