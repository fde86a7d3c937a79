"""CANopen (CiA 301), a file a service."""
