# SPDX-License-Identifier: Apache-2.0
"""The web server of the monitor's page, and the values that the page shows."""
