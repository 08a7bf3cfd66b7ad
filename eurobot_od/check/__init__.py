"""Scripted node checks: suites of steps in YAML, run against real or simulated nodes.

Rule of this package: a suite is read and checked as a whole before anything is sent; running it knows nothing of YAML,
and reporting nothing of running.
"""
