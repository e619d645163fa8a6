"""The gear's motion in time, with friction that sticks, and what is measured of it."""
