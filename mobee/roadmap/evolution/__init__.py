# SPDX-License-Identifier: Apache-2.0
"""Evolution strategies (thesis 3.2)."""
