"""The egocentric model: whole-body state, contacts and constraint forces, once a tick."""
