"""Recorded traffic: log files to frames, frames to meanings, meanings to text, JSON lines and CSV.

Rule of this package: what a frame means depends on nothing but the frame. Reading a log yields for every entry what
its frame was understood as; each distinct frame is understood once, and memory does not grow with the log.
"""
