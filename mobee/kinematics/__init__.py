"""Forward kinematics, Jacobians and quaternions of a tree in zero-position form, of many poses at once; defined in `mobee.reference`."""

from mobee.kinematics.forward import link_transforms
from mobee.kinematics.jacobian import joint_axes, point_jacobian

__all__ = ["joint_axes", "link_transforms", "point_jacobian"]
