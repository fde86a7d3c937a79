"""Random outages of EtherCAT during fast moves: draw, execution, verdict."""
