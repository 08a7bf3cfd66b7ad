"""Faults on demand: what can be wrong with a device, each as a class of node that does just that.

Every fault names the step of a suite that finds it. What can be wrong with the nodes of one network only, such as the
robot's, stands with those nodes, made of the same hooks.
"""
