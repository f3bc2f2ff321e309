"""Evolution strategies (thesis 3.2)."""
