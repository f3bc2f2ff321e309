"""Converts rotations and quaternions; the only module that knows the order w, x, y, z (w >= 0)."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array


def from_matrix(rotation: Array) -> Array:
    """Unit quaternions wxyz, shape (..., 4), of rotation matrices (..., 3, 3)."""
    r = rotation
    trace = np.trace(r, axis1=-2, axis2=-1)
    # Outer product of the quaternion with itself, times 4; its largest column divides without loss (Shepperd 1978).
    outer = np.empty((*r.shape[:-2], 4, 4))
    outer[..., 0, 0] = 1.0 + trace
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        outer[..., i + 1, i + 1] = 1.0 + 2.0 * r[..., i, i] - trace
        outer[..., 0, i + 1] = outer[..., i + 1, 0] = r[..., k, j] - r[..., j, k]
        outer[..., j + 1, k + 1] = outer[..., k + 1, j + 1] = r[..., j, k] + r[..., k, j]
    best = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(outer, best[..., None, None], axis=-1)[..., 0]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0.0, -q, q)


def to_matrix(quaternion: Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions wxyz (..., 4), which are normalised first."""
    q = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
