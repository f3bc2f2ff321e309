# SPDX-License-Identifier: Apache-2.0
"""Programs that write the shipped robot files from numbers."""
