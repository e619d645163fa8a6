"""Predicts and simulates the shimmy limit cycles of a landing gear, at home in ROS 2."""
