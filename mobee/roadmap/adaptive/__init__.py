"""Maps that adapt to what the robot meets (thesis 4.2, 4.3, 9.4.5)."""
