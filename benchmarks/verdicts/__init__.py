"""Verdicts put to the test: random gears, integrated in time by a code of its own."""
