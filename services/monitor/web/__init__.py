# SPDX-License-Identifier: Apache-2.0
"""The web server of the page, and what the page shows."""
