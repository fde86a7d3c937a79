"""The nearest robot that consists of bodies: conditions, the program that meets them, the result.

Base parameters as least squares gives them may belong to no bodies at all, and simulators refuse
those. `nearest_robot` finds the nearest ones that some bodies have, and such bodies.
"""
