"""Identification of robot dynamics and friction on the machine itself."""
