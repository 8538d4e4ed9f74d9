"""Transports to real wires: UDP sockets, serial ports, CAN buses."""
