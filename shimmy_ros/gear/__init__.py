"""The landing gear: its parameters, its matrices, and the system that they make."""
