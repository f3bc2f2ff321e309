# SPDX-License-Identifier: Apache-2.0
"""Pictures of robots and worlds, computed on the CPU and without a display: camera pictures, poses, filmstrips, clouds of points."""
