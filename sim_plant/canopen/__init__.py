"""A CANopen slave after CiA 301: one file for each service."""
