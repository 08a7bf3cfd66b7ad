"""A bus and the nodes on it: real or in-process in real time, or simulated with its timing."""
