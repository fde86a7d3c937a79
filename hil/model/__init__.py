"""The robot as equations: its file, base parameters, regressor, motors.

Knows nothing of measuring. Sections 4 and 5 of Grotjahn, Daemi and Heimann (2001).
"""
