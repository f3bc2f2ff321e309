"""The narrow phase: whether two placed volumes overlap, how deep, which way out and where; or how far apart they are.

Depth is the smallest translation that separates the pair.  Two rounded volumes, or one and a box: the Minkowski difference
is a polytope inflated by the radii, so outside the polytope the depth is the radii minus the distance, and inside it the
smallest overlap over the polytope's faces.  Where the answer is not unique the middle of what is equally good is taken, and
among equally short ways out always the same, so that rounding cannot choose.
"""
