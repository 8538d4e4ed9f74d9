"""The hand on its EtherCAT cable: start-up, identity, process data, the motors' CAN buses."""
