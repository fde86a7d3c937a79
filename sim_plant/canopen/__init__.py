"""CANopen slave after CiA 301, with a module for every service."""
