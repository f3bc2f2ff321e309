"""The learned reacher and a planner on the live PyBullet robot; `claim` is the experiment."""
