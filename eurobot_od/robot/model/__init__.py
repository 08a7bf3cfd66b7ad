"""The contents of the robot's messages, and the facts of the robot and its match: types, values, body, field, tasks."""
