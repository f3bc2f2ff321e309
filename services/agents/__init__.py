"""A curious agent that explores the configuration space of one part."""
