"""Machines of a trial as network namespaces with one network between them, whose links can be cut. Needs root."""

import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

_PROGRAM = shutil.which("ip", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
_SWITCH, _PORT = "lan0", "outside"


def _ip(*words: str) -> str:
    """Run `ip` of iproute2. Raises OSError with what it said."""
    ran = subprocess.run([_PROGRAM or "ip", *words], capture_output=True, text=True, check=False)
    if ran.returncode:
        raise OSError(f"ip {' '.join(words)}: {ran.stderr.strip()}")
    return ran.stdout


def why_not() -> str:
    """Return why there can be no such machines here, "" if there can."""
    if os.geteuid() != 0 or _PROGRAM is None:
        return "network namespaces need root and iproute2"
    try:
        with _namespaces(f"dr{os.getpid()}", ["try"]):
            return ""
    except OSError as error:
        return f"network namespaces cannot be made here: {error}"


class Hosts:
    """Namespaces with addresses of one network. This process has the address `outside` in it."""

    def __init__(self, name: str, network: str) -> None:
        self._name = name
        self._network = network
        self.outside = f"{network}.254"

    def address(self, number: int) -> str:
        return f"{self._network}.{number}"

    def command(self, number: int, words: Sequence[str]) -> list[str]:
        """Return the command that runs these words on a host."""
        return [_PROGRAM or "ip", "netns", "exec", f"{self._name}-{number}", *words]

    def settings(self, number: int) -> list[str]:
        """Return the settings that a service needs to listen there, for the top of its file."""
        return ["insecure = true", f'http.host = "{self.address(number)}"']

    def set_link(self, number: int, how: str) -> None:
        """Plug the cable of a host out or in, at the switch. how: "down" or "up"."""
        _ip("-n", f"{self._name}-{_SWITCH}", "link", "set", f"host{number}", how)

    def add(self, number: int) -> None:
        switch, host = f"{self._name}-{_SWITCH}", f"{self._name}-{number}"
        _ip("-n", switch, "link", "add", f"host{number}", "type", "veth", "peer", "name", "eth0", "netns", host)
        _ip("-n", switch, "link", "set", f"host{number}", "master", _SWITCH, "up")
        _ip("-n", host, "address", "add", f"{self.address(number)}/24", "dev", "eth0")
        for device in ("eth0", "lo"):
            _ip("-n", host, "link", "set", device, "up")

    def add_outside(self) -> None:
        switch = f"{self._name}-{_SWITCH}"
        _ip("link", "add", self._name, "type", "veth", "peer", "name", _PORT, "netns", switch)
        _ip("-n", switch, "link", "set", _PORT, "master", _SWITCH, "up")
        _ip("address", "add", f"{self.outside}/24", "dev", self._name)
        _ip("link", "set", self._name, "up")


@contextmanager
def running_hosts(numbers: Iterable[int]) -> Iterator[Hosts]:
    """Give hosts with these numbers, and remove them after the block. Whoever runs something there ends it."""
    name, known = f"dr{os.getpid()}", _ip("route")
    network = next(found for third in range(256) if f"{(found := f'198.18.{third}')}." not in known)
    listed = list(numbers)
    with _namespaces(name, [_SWITCH, *map(str, listed)]):
        _ip("-n", f"{name}-{_SWITCH}", "link", "add", "name", _SWITCH, "type", "bridge")
        _ip("-n", f"{name}-{_SWITCH}", "link", "set", _SWITCH, "up")
        hosts = Hosts(name, network)
        hosts.add_outside()
        for number in listed:
            hosts.add(number)
        yield hosts


@contextmanager
def _namespaces(name: str, ends: Iterable[str]) -> Iterator[None]:
    """Make namespaces, and remove them after the block, with the links in them."""
    made: list[str] = []
    try:
        for end in ends:
            _ip("netns", "add", f"{name}-{end}")
            made.append(f"{name}-{end}")
        yield
    finally:
        with suppress(OSError):
            _ip("link", "delete", name)
        for each in made:
            _ip("netns", "delete", each)
