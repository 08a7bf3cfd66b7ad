"""The check suites that come with the robot, and what its nodes do while they are checked."""
