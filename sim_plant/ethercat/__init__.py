"""Drives of the plant as EtherCAT slaves (ETG.1000), for any master."""
