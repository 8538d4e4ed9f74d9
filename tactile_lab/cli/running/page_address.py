"""Address of a page, from command line options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from drivers.core.errors import ConfigurationError

HERE, PORT = "127.0.0.1", 8090
_PANEL = "Browser page"
LEAST_TOKEN = 16

View = Annotated[bool, typer.Option("--view", help="Also show and control this in a browser.", rich_help_panel=_PANEL)]
Port = Annotated[
    int,
    typer.Option("--view-port", min=0, max=65535, help="Port of the page; 0: any free port.", rich_help_panel=_PANEL),
]
Listen = Annotated[
    str,
    typer.Option(
        "--listen",
        metavar="ADDRESS",
        help="Address of the page; 0.0.0.0: all of this computer's. Whoever has the token may press buttons.",
        rich_help_panel=_PANEL,
    ),
]
Token = Annotated[
    str,
    typer.Option(
        "--token",
        envvar="TACTILE_LAB_TOKEN",
        help="Access token that visitors of the page must give.",
        show_default="a new one",
        rich_help_panel=_PANEL,
    ),
]


Certificate = Annotated[
    Path | None,
    typer.Option(
        "--certificate",
        metavar="FILE",
        help="PEM file with the page's certificate and its key: the page is then encrypted (https).",
        rich_help_panel=_PANEL,
    ),
]


@dataclass(frozen=True)
class PageAddress:
    """Address, port, token and certificate as typed."""

    address: str
    port: int
    token: str
    certificate: Path | None = None

    @classmethod
    def if_wanted(
        cls, view: bool, address: str, port: int, token: str, certificate: Path | None = None
    ) -> PageAddress | None:
        """The address if a page was requested. Raises BadParameter for an address without a page."""
        for option, given in (
            ("--listen", address != HERE),
            ("--view-port", port != PORT),
            ("--certificate", certificate is not None),
        ):
            if given and not view:
                raise typer.BadParameter("needs --view", param_hint=f"'{option}'")
        return cls(address, port, token, certificate) if view else None

    def check(self) -> tuple[str, int, str, str]:
        """Address, port, token, and the certificate's file or "", to use. Raises ConfigurationError.

        There is a token always: on this computer, too, other users' programs could press the buttons.
        """
        from drivers.core.installed.extras import require_package
        from tactile_lab.view.certificates import load_certificate
        from tactile_lab.view.gate import new_token

        require_package("viser")
        token = new_token() if self.token in ("", "new") else self.token
        if len(token) < LEAST_TOKEN or not all(c.isalnum() or c in "-_" for c in token) or not token.isascii():
            text = f"a token needs at least {LEAST_TOKEN} letters, digits, - or _"
            raise ConfigurationError(text, where="--token", hint="Use --token new to create one")
        if self.certificate is not None:
            load_certificate(self.certificate)  # what is wrong with it is told before anything starts
        return self.address, self.port, token, str(self.certificate.resolve()) if self.certificate else ""
