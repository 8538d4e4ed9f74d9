"""The web pages of a Net F/T box: reads its identity and settings, and sets its rate (protocols: Net F/T)."""

from __future__ import annotations

import http.client
import math
from dataclasses import dataclass

from drivers.ati.protocols.cal_file import FORCE_UNITS_N, TORQUE_UNITS_Nm
from drivers.ati.protocols.xml_text import LARGEST, parse_xml
from drivers.core.errors import CodecError, DeviceError

PAGE = "/netftapi2.xml"
INTERNAL_RATE_Hz = 7000
_HINT = "Is the box switched on and in the same network? Open its address in a browser"


@dataclass(frozen=True)
class NetBoxPage:
    """What a box reports about itself.

    Attributes:
        product, firmware: for display only.
        serial: of the calibration in use (``cfgcalsn``), as ``FT12345``.
        counts_per_N, counts_per_Nm: its scale in SI units, whichever unit the box is set to.
        rate_hz: records per second of its real-time stream.
        rdt_enabled: whether its stream is enabled.
        status: its status word.
        tool: the six values of its tool transform.
    """

    product: str
    firmware: str
    serial: str
    counts_per_N: float
    counts_per_Nm: float
    rate_hz: int
    rdt_enabled: bool
    status: int
    tool: tuple[float, ...]


def achievable_rate(wanted_hz: int) -> int:
    """The rate that the box sets for a requested one: 7 kHz divided by an integer, rounded."""
    return round(INTERNAL_RATE_Hz / max(1, round(INTERNAL_RATE_Hz / wanted_hz)))


def parse_page(content: bytes) -> NetBoxPage:
    """Read ``netftapi2.xml``.

    Raises:
        CodecError: the text is not such a page, or is incomplete.
    """
    try:
        root = parse_xml(content)
        words = {element.tag.lower(): (element.text or "").strip() for element in root.iter()}
        return NetBoxPage(
            product=words.get("prodname", ""),
            firmware=words.get("mfgdigver", ""),
            serial=words["cfgcalsn"],
            counts_per_N=_positive(words["cfgcpf"]) / FORCE_UNITS_N[words["scfgfu"]],
            counts_per_Nm=_positive(words["cfgcpt"]) / TORQUE_UNITS_Nm[words["scfgtu"]],
            rate_hz=int(words["comrdtrate"]),
            rdt_enabled=words.get("comrdte", "1").lower() in {"1", "enabled", "on"},
            status=int(words.get("runstat", "0"), 0),
            tool=tuple(float(word) for word in words.get("cfgtfx", "0;0;0;0;0;0").split(";")),
        )
    except (KeyError, ValueError) as error:
        raise CodecError(f"the page is not that of a Net F/T box ({error})", where=PAGE, hint=_HINT) from error


def fetch_page(host: str, port: int, timeout_s: float = 2.0) -> NetBoxPage:
    """Read the page of a box.

    Raises:
        DeviceError: nothing answers; CodecError: the answer is not from a Net F/T box.
    """
    return parse_page(_get(host, port, PAGE, timeout_s))


def set_rate(host: str, port: int, rate_hz: int, timeout_s: float = 2.0) -> NetBoxPage:
    """Set the rate of the real-time stream and read back the rate that the box chose.

    Raises:
        DeviceError: as :func:`fetch_page`, or the box did not accept the rate.
    """
    _get(host, port, f"/comm.cgi?comrdtrate={rate_hz}", timeout_s)
    page = fetch_page(host, port, timeout_s)
    if page.rate_hz not in (rate_hz, achievable_rate(rate_hz)):
        raise DeviceError(
            f"{rate_hz} records per second were requested, but the box stays at {page.rate_hz}",
            where=f"{host}:{port}",
            hint="Set the RDT output rate on the box's Communications page",
        )
    return page


def _get(host: str, port: int, path: str, timeout_s: float) -> bytes:
    connection = http.client.HTTPConnection(host, port, timeout=timeout_s)
    try:
        connection.request("GET", path)
        answer = connection.getresponse()
        content = answer.read(LARGEST + 1)
    except (OSError, http.client.HTTPException) as error:
        raise DeviceError(
            f"no web page from the box ({getattr(error, 'strerror', None) or error or type(error).__name__})",
            where=f"{host}:{port}",
            hint=_HINT,
        ) from error
    finally:
        connection.close()
    if answer.status >= 400:
        raise DeviceError(f"the box refuses {path} ({answer.status} {answer.reason})", where=f"{host}:{port}")
    return content


def _positive(word: str) -> float:
    if not (math.isfinite(value := float(word)) and value > 0):
        raise ValueError(f"{word!r} is not a scale")
    return value
