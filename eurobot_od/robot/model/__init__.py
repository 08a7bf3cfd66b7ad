"""What the robot's messages say, and the facts of the robot and its match: types, values, body, field, tasks."""
