# SPDX-License-Identifier: Apache-2.0
"""Robot files by other authors: of 2010 to 2014, of today's robots, and URDFs in general."""
