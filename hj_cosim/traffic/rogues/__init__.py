"""Drivers who mean harm: what each of them does to the robot, within the road and what its car can."""
