"""Shared memory of one laboratory's emulators: the plant's newest state, and the demands that drive it.

The plant's process writes the state after every step and reads the demands before the next. Emulators, each in its own
process, read the state whenever their device would measure, and write their own demand. No process waits for another:
what is being written lies beside what is read. Emulators have real-time priorities above the plant's; one that waited
until the plant has written would keep it from writing.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from gtsam import Pose3
from numpy.typing import NDArray

from drivers.core.clock import Clock
from drivers.core.contacts import FINGERS, Array
from drivers.core.errors import DeviceError
from drivers.simulation.hand_plant import TrueContact

_STATE = np.dtype(
    [
        ("joints_rad", "<f8", 24),
        ("motor_torque_Nm", "<f8", 20),
        ("base", "<f8", 6),
        ("wrenches", "<f8", (5, 6)),
        ("world_T_object", "<f8", (4, 4)),
    ]
)
_MOST_CONTACTS = 64
_TOUCHED = ("object", "table")
_CONTACT = np.dtype(
    [
        ("finger", "u1"),
        ("touched", "u1"),
        ("point_m", "<f8", 3),
        ("normal", "<f8", 3),
        ("force_N", "<f8", 3),
        ("slides_m_s", "<f8"),
    ]
)
_TOUCHES = np.dtype(
    [("world_T_distal", "<f8", (len(FINGERS), 4, 4)), ("count", "<i4"), ("contact", _CONTACT, _MOST_CONTACTS)]
)
_PLACES = 8
"""The plant writes in turn to so many: a reader has copied from one long before it is written again."""
_MEMORY = np.dtype(
    [
        ("stamp_ns", "<i8"),
        ("lost_ns", "<i8"),
        ("state_count", "<u8"),  # how many were written; the newest lies at its place modulo _PLACES
        ("state", _STATE, _PLACES),
        ("touches_count", "<u8"),
        ("touches", _TOUCHES, _PLACES),
        ("duty", "<f8", 20),
        ("base_target", "<f8", 6),
    ]
)


class PlantMirror:
    """A plant as an emulator sees it through shared memory; times are those of the common clock.

    Args:
        path: the file that holds the memory, made by :meth:`create`.
        clock: for :attr:`stamp_ns`; a device measures when it is read.

    Raises:
        DeviceError: there is no such file, or it belongs to another program.
    """

    def __init__(self, path: Path, clock: Clock) -> None:
        self._clock = clock
        try:
            with path.open("r+b") as file:
                if os.fstat(file.fileno()).st_size != _MEMORY.itemsize:
                    raise DeviceError(
                        "is not the memory of a simulated plant", where=str(path), hint="Start the laboratory again"
                    )
                self._memory = np.frombuffer(mmap.mmap(file.fileno(), _MEMORY.itemsize), _MEMORY)
        except OSError as error:
            raise DeviceError(
                f"the memory of the simulated plant cannot be opened ({error.strerror})", where=str(path)
            ) from error

    @classmethod
    def create(cls, path: Path, clock: Clock, base: Array) -> PlantMirror:
        """Create the memory; the positioner's target is its present position."""
        path.write_bytes(bytes(_MEMORY.itemsize))
        mirror = cls(path, clock)
        mirror._memory["base_target"][0] = base
        return mirror

    # --- for emulators -----------------------------------------------------------------------------------------

    @property
    def stamp_ns(self) -> int:
        """Present time."""
        return self._clock.now_ns()

    @property
    def joints_rad(self) -> Array:
        """True joint angles, shape (24,)."""
        return np.asarray(self._state()["joints_rad"])

    @property
    def motor_torque_Nm(self) -> Array:
        """Torque of each driven joint's motor, shape (20,)."""
        return np.asarray(self._state()["motor_torque_Nm"])

    @property
    def base(self) -> Array:
        """True positioner joints, shape (6,)."""
        return np.asarray(self._state()["base"])

    @property
    def wrenches(self) -> Array:
        """Loads on the five fingertips, shape (5, 6), sensor frames."""
        return np.asarray(self._state()["wrenches"])

    @property
    def world_T_object(self) -> Pose3:
        """True pose of the object."""
        return Pose3(np.asarray(self._state()["world_T_object"]))

    def contacts(self) -> tuple[TrueContact, ...]:
        """All contacts of fingertips; empty if the plant does not publish them."""
        touches = self._read("touches")
        return tuple(map(_contact, touches["contact"][: int(touches["count"])]))

    def world_T_distal(self, finger: str) -> Pose3:
        """True pose of a finger's distal frame, if the plant publishes contacts."""
        return Pose3(np.asarray(self._read("touches")["world_T_distal"][FINGERS.index(finger)]))

    def drive(self, duty: Array) -> None:
        """Set the duty cycles, shape (20,), -1 to 1."""
        self._memory["duty"][0] = duty

    def move_base(self, target: Array) -> None:
        """Set the positioner's targets, shape (6,)."""
        self._memory["base_target"][0] = target

    # --- for the plant -----------------------------------------------------------------------------------------

    @property
    def demands(self) -> tuple[Array, Array]:
        """Duty cycles, shape (20,), and the positioner's targets, shape (6,)."""
        return self._memory["duty"][0].copy(), self._memory["base_target"][0].copy()

    def publish(
        self, stamp_ns: int, joints_rad: Array, torque_Nm: Array, base: Array, wrenches: Array, world_T_object: Pose3
    ) -> None:
        """Publish a new state; see the properties for shapes."""
        memory, count = self._memory, self._next("state")
        memory["state"][0, count % _PLACES] = (joints_rad, torque_Nm, base, wrenches, world_T_object.matrix())
        memory["stamp_ns"] = stamp_ns
        memory["state_count"] = count

    def publish_touches(self, contacts: Sequence[TrueContact], world_T_distal: Sequence[Pose3]) -> None:
        """Publish the fingertips' contacts (if there are too many, the first), and the distal frames of all fingers."""
        rows = [_row(contact) for contact in contacts[:_MOST_CONTACTS]]
        count = self._next("touches")
        touches = self._memory["touches"][0, count % _PLACES]
        touches["world_T_distal"] = [pose.matrix() for pose in world_T_distal]
        touches["contact"][: len(rows)] = rows
        touches["count"] = len(rows)
        self._memory["touches_count"] = count

    def count_lost(self, lost_ns: int) -> None:
        """Count time that the plant skipped because it was late."""
        self._memory["lost_ns"] += lost_ns

    # --- for people --------------------------------------------------------------------------------------------

    @property
    def lost_ns(self) -> int:
        """Total time that the plant has skipped."""
        return int(self._memory["lost_ns"][0])

    @property
    def age_ns(self) -> int:
        """How old the state is."""
        return self._clock.now_ns() - int(self._memory["stamp_ns"][0])

    def _state(self) -> NDArray[np.void]:
        return self._read("state")

    def _next(self, part: str) -> int:
        """The count of the one that is written next."""
        return int(self._memory[f"{part}_count"][0]) + 1

    def _read(self, part: str) -> NDArray[np.void]:
        """The newest that was written whole; copied again if the plant has come round to its place meanwhile."""
        memory = self._memory
        while True:
            count = int(memory[f"{part}_count"][0])
            content: NDArray[np.void] = memory[part][0, count % _PLACES].copy()
            if int(memory[f"{part}_count"][0]) < count + _PLACES - 1:
                return content


def _row(contact: TrueContact) -> tuple[object, ...]:
    finger, touched = FINGERS.index(contact.finger), _TOUCHED.index(contact.touched)
    placed = contact.point_world_m, contact.normal_world, contact.force_on_tip_world_N
    return finger, touched, *placed, contact.slides_m_s


def _contact(row: np.void) -> TrueContact:
    touched: Literal["object", "table"] = "table" if row["touched"] else "object"
    placed = row["point_m"], row["normal"], row["force_N"]
    return TrueContact(FINGERS[row["finger"]], touched, *placed, float(row["slides_m_s"]))
