"""Simulated time: a CAN bus, and an asyncio event loop on its clock.

The same seed always gives the same frames; nothing reads the real clock.
"""
