# SPDX-License-Identifier: Apache-2.0
"""Robot files by other authors: files of MoBeE from 2010 to 2014, files of today's robots, and URDF files in general."""
