"""The plant's drives as EtherCAT slaves (ETG.1000), for any master."""
