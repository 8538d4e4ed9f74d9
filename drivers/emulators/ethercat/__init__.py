"""The hand's emulated EtherCAT slaves, as seen by a master."""
