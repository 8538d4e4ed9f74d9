"""What a rig file says of the wire of a fingertip's force sensor."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from drivers.core.configuration import StrictModel

Port = Annotated[int, Field(ge=1, le=65535)]


class WireSettings(StrictModel):
    """Settings of one finger's wire. Each wire has a model of its own, with ``wire`` as a ``Literal``.

    Attributes:
        wire: its registered name.
    """

    wire: str
