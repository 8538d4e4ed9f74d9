"""Clients that we did not write take the emulated units for the real ones."""

from __future__ import annotations

from pathlib import Path

import can
import numpy as np
import pytest

from drivers.ati.protocols.digital_calibration import BLOCK, FIRST_REGISTER, decode_block
from drivers.emulators.ati.can_server import CanServer
from drivers.emulators.ati.can_unit import CanUnit
from drivers.emulators.ati.digital_unit import DigitalUnit
from drivers.emulators.ati.net_box_server import NetBoxServer
from drivers.emulators.ati.net_box_unit import NetBoxUnit
from drivers.emulators.ati.sensor import EmulatedSensor
from drivers.emulators.pty_port import PtyPort

PRESSED = np.array([1.0, -0.5, 2.0, 0.010, -0.004, 0.002])


def pressed_sensor() -> EmulatedSensor:
    sensor = EmulatedSensor(noise_counts=0.0)
    sensor.press(PRESSED)
    return sensor


def test_the_netft_client_reads_the_emulated_box() -> None:
    netft = pytest.importorskip("NetFT", reason="the independent RDT client NetFT is not installed")
    with NetBoxServer(NetBoxUnit(pressed_sensor()), "127.0.0.23") as box:
        client = netft.Sensor("127.0.0.23")
        try:
            client.sock.settimeout(5.0)
            assert box.port == client.port
            np.testing.assert_allclose(np.array(client.getMeasurement()) / 1e6, PRESSED, atol=5e-3)
            client.tare(5)
            client.send(0)
        finally:
            client.sock.close()


def test_pymodbus_reads_the_calibration_of_the_emulated_sensor() -> None:
    pymodbus = pytest.importorskip("pymodbus.client", reason="pymodbus is not installed")
    sensor = pressed_sensor()
    with PtyPort(DigitalUnit(sensor), 115_200) as port:
        client = pymodbus.ModbusSerialClient(port.path, baudrate=115_200, parity="N", timeout=2)
        assert client.connect()
        try:
            words: list[int] = []
            for first, count in ((FIRST_REGISTER, 96), (FIRST_REGISTER + 96, BLOCK.size // 2 - 96)):
                answer = client.read_holding_registers(first, count=count, device_id=10)
                assert not answer.isError()
                words += answer.registers
            refused = client.read_holding_registers(0xFFF0, count=4, device_id=10)
        finally:
            client.close()
    read = decode_block(b"".join(word.to_bytes(2, "big") for word in words))
    np.testing.assert_allclose(read.working_matrix, sensor.calibration.working_matrix, rtol=1e-6)
    assert refused.isError()


def test_traffic_of_the_emulated_board_passes_python_cans_own_log_files(tmp_path: Path) -> None:
    log = tmp_path / "board.log"
    with (
        CanServer(CanUnit(pressed_sensor()), can.Bus(interface="virtual", channel="log")),
        can.Bus(interface="virtual", channel="log") as bus,
        can.Logger(str(log)) as logger,
    ):
        bus.send(can.Message(arbitration_id=0x200, is_extended_id=False))
        seen = [bus.recv(5.0) for _ in range(2)]
        for message in seen:
            assert message is not None
            logger(message)
    with can.LogReader(str(log)) as reader:
        read = [(message.arbitration_id, bytes(message.data)) for message in reader]
    assert read == [(message.arbitration_id, bytes(message.data)) for message in seen if message]
    assert [identifier for identifier, _ in read] == [0x200, 0x201]
