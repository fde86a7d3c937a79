"""CANopen over EtherCAT: a file a service, as `drivers.canopen` for CAN."""
