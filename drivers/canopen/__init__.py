"""CANopen (CiA 301): services of the drives on a CAN bus."""
