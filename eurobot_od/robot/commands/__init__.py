"""The robot's own commands, as those of `cli`, and what it adds to `node`."""
