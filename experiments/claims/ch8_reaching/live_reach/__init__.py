"""Live reach: the learned reacher on the live PyBullet robot, beside the planner; `claim` is the experiment."""
