"""The definitions in NumPy: each function beside its equation, for one pose or one tick.

What runs is the compiled form of the same; the tests compare the two.  Nothing of the library imports this package.

- `kinematics`: links, markers and Jacobians at a pose (thesis 2.3.1, eq. 5.1).
- `contact_forces`: what contacts do to the motors, the sum of J^T f (eq. 5.11).
- `forces`: every force of eq. 5.7, in both laws (eqs. 5.8 to 5.17).
- `law`: their sum, a step of the dynamical system and its commands; a force of your own goes into its list.
- `reach`: the force that draws a marker to a target (thesis 8.2).
- `motors`: what a command becomes on its way to the joint, and the noise of the encoders.
- `plant`: all of the above, tick by tick: where a force of your own can be tried.
- `learning`: Algorithms 6 and 7, and the reward of a curious agent (thesis 6.4, 6.5).
"""
