"""Robot model: robot file, base parameters, regressor, motors.

Independent of measurements. Sections 4 and 5 of Grotjahn, Daemi and Heimann (2001).
"""
