"""Layouts of the 0220 palm's process image as the vendor's header declares them, independent of the codec's own."""

from __future__ import annotations

import numpy as np

from drivers.shadow.protocol.palm_codec import CAN_BRIDGE, SENSORS

COMMAND_0220 = np.dtype(
    [
        ("edc_command", "<u4"),
        ("from_motor_data_type", "<u4"),
        ("which_motors", "<i2"),
        ("to_motor_data_type", "<u4"),
        ("motor_data", "<i2", 20),
        ("tactile_data_type", "<u4"),
        ("can", CAN_BRIDGE),
    ]
)
"""Host to palm, 58 + 12 bytes."""

STATUS_0220 = np.dtype(
    [
        ("edc_command", "<u4"),
        ("sensors", "<u2", len(SENSORS)),
        ("motor_data_type", "<u4"),
        ("which_motors", "<i2"),
        ("which_motor_data_arrived", "<u4"),
        ("which_motor_data_had_errors", "<u4"),
        ("motor_data_packet", [("torque", "<i2"), ("misc", "<u2")], 10),
        ("tactile_data_type", "<u4"),
        ("tactile_data_valid", "<u2"),
        ("tactile", "u1", (5, 16)),
        ("idle_time_us", "<u2"),
        ("can", CAN_BRIDGE),
    ]
)
"""Palm to host, 220 + 12 bytes."""
