"""What is neither CAN nor CANopen: amounts, durations, files, text that is made harmless, YAML with places, SVG."""
