"""A virtual CAN plant: servo drives as CANopen slaves in front of the physics of an arm.

It is reached through frames only: as a python-can interface,
``can.Bus(interface="sim_plant", channel="manutec-r15")``, or served on any other bus by
``python -m sim_plant``. Everything that it reports is simulated.
"""
