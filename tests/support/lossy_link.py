"""A second host as a network namespace on this machine, and a link to it that loses packets.

This process is the link: it forwards or drops the packets between two TUN devices. It works without `netem`.
"""

import fcntl
import os
import random
import select
import struct
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from ipaddress import IPv4Address
from threading import Event, Thread

import pytest

_NETWORK = IPv4Address("198.18.0.0")  # reserved for tests between devices (RFC 2544): 2**17 addresses
_TUNSETIFF = 0x400454CA
_TUN_WITHOUT_HEADER = 0x1001
_MTU = 1500


class LossyLink:
    """here, there: addresses of the two hosts; each process has its own pair. loss: share of packets to drop from now
    on, in each direction. carried, lost: number of packets so far."""

    def __init__(self, namespace: str) -> None:
        self.namespace = namespace
        first = _NETWORK + 2 * (os.getpid() % 2**16)
        self.here, self.there = str(first), str(first + 1)
        self.loss = 0.0
        self.carried = self.lost = 0

    def elsewhere(self, *command: str) -> list[str]:
        """Return the command line that runs the command on the other host."""
        return ["ip", "netns", "exec", self.namespace, *command]

    def forward(self, devices: tuple[int, int], stop: Event) -> None:
        """Forward packets between the two devices until `stop` is set."""
        chance = random.Random(15)
        here, there = devices
        while not stop.is_set():
            for device in select.select(devices, [], [], 0.1)[0]:
                packet = os.read(device, 2 * _MTU)
                if chance.random() < self.loss:
                    self.lost += 1
                else:
                    os.write(there if device == here else here, packet)
                    self.carried += 1


@contextmanager
def lossy_link() -> Iterator[LossyLink]:
    """Make the second host and the link to it, and remove both at the end. Skip the test where that is not possible."""
    if os.geteuid() != 0:
        pytest.skip("this test makes a network namespace and must run as root")
    name = f"dropanchor-{os.getpid()}"
    with ExitStack() as made:
        try:
            _ip("netns", "add", name)
            made.callback(_ip, "netns", "del", name)
            devices = _device(f"da{os.getpid()}"), _device(f"db{os.getpid()}")
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"this system does not allow a network namespace or a TUN device: {error}")
        for device in devices:
            made.callback(os.close, device)
        link, stop = LossyLink(name), Event()
        _address(f"da{os.getpid()}", link.here, link.there, [])
        _ip("link", "set", f"db{os.getpid()}", "netns", name)
        _address(f"db{os.getpid()}", link.there, link.here, link.elsewhere())
        thread = Thread(target=link.forward, args=(devices, stop))
        thread.start()
        made.callback(thread.join)
        made.callback(stop.set)
        yield link


def _device(name: str) -> int:
    device = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(device, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _TUN_WITHOUT_HEADER))
    return device


def _address(device: str, own: str, peer: str, where: list[str]) -> None:
    subprocess.run([*where, "ip", "addr", "add", own, "peer", peer, "dev", device], check=True)
    subprocess.run([*where, "ip", "link", "set", device, "up"], check=True)


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)
