"""The hand's EtherCAT slaves as a master meets them."""
