"""Conversion of URDF, MJCF and Denavit-Hartenberg tables to robot files."""
