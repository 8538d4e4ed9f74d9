"""Error counters of a slave controller: damage seen on each port since power-up or since they were last cleared."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.core.errors import CodecError

PORTS = 4
_PHYSICAL, _LOST, _SIZE = 1, 16, 20
_SATURATED = 255


@dataclass(frozen=True)
class PortErrors:
    """The counters of one slave (protocols: Slave registers); each stops at 255.

    Attributes:
        damaged: by port, frames that arrived with a wrong check sequence, and invalid symbols outside frames. Frames
            already damaged on an earlier cable are not counted.
        lost_links: by port, how often the link was lost.
    """

    damaged: tuple[int, ...]
    lost_links: tuple[int, ...]

    SIZE = _SIZE

    @classmethod
    def decode(cls, data: bytes) -> PortErrors:
        """Read the bytes at :attr:`~drivers.ethercat.registers.Register.ERROR_COUNTERS`.

        Raises:
            CodecError: wrong number of bytes.
        """
        if len(data) != cls.SIZE:
            raise CodecError(f"error counters of {len(data)} bytes", where="EtherCAT slave")
        damaged = (max(data[2 * port], data[2 * port + _PHYSICAL]) for port in range(PORTS))
        return cls(tuple(damaged), tuple(data[_LOST : _LOST + PORTS]))

    def at(self, port: int) -> CableErrors:
        """What one port has counted on its cable."""
        return CableErrors(self.damaged[port], self.lost_links[port])


@dataclass(frozen=True)
class CableErrors:
    """What the ends of one cable have counted: damaged frames and lost links."""

    damaged: int = 0
    lost_links: int = 0

    def both(self, other: CableErrors) -> CableErrors:
        """Combine with the counts of the other end: each end counts the frames that arrive there, and both see link
        losses.
        """
        return CableErrors(self.damaged + other.damaged, max(self.lost_links, other.lost_links))

    def __str__(self) -> str:
        """For people: ``3 damaged frames, link lost 2 times``; empty if nothing was counted."""
        words = {
            f"{self._count(self.damaged)} damaged frames": self.damaged,
            f"link lost {self._count(self.lost_links)} times": self.lost_links,
        }
        return ", ".join(text for text, count in words.items() if count)

    @staticmethod
    def _count(count: int) -> str:
        return f"{count} or more" if count >= _SATURATED else str(count)
