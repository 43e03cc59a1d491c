"""The paper's game of the robot and one other car."""
