# SPDX-License-Identifier: Apache-2.0
"""One readable file per claim: the claim, its source, the published number, and the run that tests it."""
