"""URDF and tables of Denavit-Hartenberg parameters, as the text of a robot file."""
