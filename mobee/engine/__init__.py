"""The compiled engine: kinematics, contacts and projected forces of one pose or of many, over packed arrays."""
