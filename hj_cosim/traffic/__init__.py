"""The world around the robot: SUMO, and a small fake for tests."""
