"""Nearest robot of physical bodies: conditions, semidefinite program, and result.

Base parameters from least squares may belong to no physical bodies, and simulators refuse such
parameters. `nearest_robot` finds the nearest base parameters of physical bodies, and such bodies.
"""
