"""Random outages of EtherCAT in a session of fast moves: drawn, let happen, judged."""
