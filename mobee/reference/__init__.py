# SPDX-License-Identifier: Apache-2.0
"""Definitions of the model, the control law and the learning in readable NumPy, with their equations, for one pose or one tick.

The programs run a compiled form of the same functions; tests compare the two. Nothing else in the library imports this package.

- `kinematics`: links, markers and Jacobians at a pose (thesis 2.3.1, eq. 5.1).
- `forces`: every force of eq. 5.7, in both variants of the control law (eqs. 5.8 to 5.17).
- `law`: the sum of the forces (eq. 5.7), one step of the dynamical system and its command; `TERMS`, the list of the forces.
- `reach`: the force that pulls a marker to a target (thesis 8.2).
- `plant`: how a motor follows its command, the noise of the encoders, and a simulated robot that runs all of the above in each tick, for
  trying a new force.
- `learning`: the transition model, its reward and value iteration (thesis 6.4, 6.5, Algorithms 6 and 7).
"""
