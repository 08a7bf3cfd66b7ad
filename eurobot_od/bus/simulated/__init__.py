"""Simulated time: a CAN bus, an asyncio event loop on its clock, and the world around the robot.

Rule of this package: the same seed gives the same frames to the byte; nothing reads the real clock.
"""
