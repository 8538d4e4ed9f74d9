"""A network cable between two virtual interfaces of this computer, for an emulated EtherCAT ring."""

from __future__ import annotations

import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.core.errors import DeviceError


@contextmanager
def virtual_cable(near: str, far: str) -> Iterator[None]:
    """Two connected interfaces for the duration of the context. Existing interfaces of these names are used and kept.

    Raises:
        DeviceError: they do not exist and cannot be created; the message says how an administrator can create them.
    """
    present = {name for _, name in socket.if_nameindex()}
    if {near, far} <= present:
        yield
        return
    _make(near, far)
    try:
        yield
    finally:
        _ip("link", "del", near)


def _make(near: str, far: str) -> None:
    if shutil.which("ip") is None:
        raise DeviceError(
            "the ip command, which creates virtual cables, is missing", where=near, hint="Install iproute2"
        )
    made = _ip("link", "add", near, "type", "veth", "peer", "name", far)
    if made.returncode:
        raise _refusal(near, far, made.stderr.strip() or "ip link add failed")
    for end in (near, far):
        if (raised := _ip("link", "set", end, "up")).returncode:
            _ip("link", "del", near)
            raise _refusal(near, far, raised.stderr.strip())


def _refusal(near: str, far: str, words: str) -> DeviceError:
    made = f"sudo ip link add {near} type veth peer name {far}"
    up = f"sudo ip link set {near} up; sudo ip link set {far} up"
    hint = (
        f"Either create it once as root ({made}; {up}) and grant raw sockets, or run the whole command in a separate "
        "network namespace: unshare -Urn sh -c 'ip link set lo up; tactile-lab ...'"
    )
    return DeviceError(f"no permission to create a virtual network cable ({words})", where=near, hint=hint)


def _ip(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
