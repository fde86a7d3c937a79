"""CANopen over EtherCAT: services of the drives on a line."""
