# SPDX-License-Identifier: Apache-2.0
"""The definitions of model, law and learning in readable NumPy: each function beside its equation, for one pose or one tick.

The programs run a compiled form of the same functions; tests compare the two. Nothing else in the library imports this package.

- `kinematics`: links, markers and Jacobians at a pose (thesis 2.3.1, eq. 5.1).
- `forces`: every force of eq. 5.7, in both variants of the control law (eqs. 5.8 to 5.17).
- `law`: the sum of the forces (eq. 5.7), one step of the dynamical system and its command; the list to which a new force is added.
- `reach`: the force that pulls a marker to a target (thesis 8.2).
- `motors`: how a motor follows its command, and the noise of the encoders.
- `plant`: all of the above, tick by tick, to try a new force.
- `learning`: the transition model, its reward and value iteration (thesis 6.4, 6.5, Algorithms 6 and 7).
"""
