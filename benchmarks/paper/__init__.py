"""Grotjahn, Daemi and Heimann (2001), line by line, on the virtual manutec-r15."""
