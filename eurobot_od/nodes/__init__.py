"""The robot's nodes, core, drive and navigation: state machines that take frames and the time and return frames."""
