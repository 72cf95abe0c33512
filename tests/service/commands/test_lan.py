"""`dropanchor serve` on all interfaces shows where other devices reach the page."""

import os
import pty
import subprocess

import pytest

from dropanchor_service.runtime.own_addresses import own_addresses, urls_for_others
from service.commands.test_key import scanned
from support.kernel_cache import compile_once
from support.patience import PATIENCE_S
from support.service import command, environment
from support.zenoh_router import free_endpoint


def test_a_service_on_the_loopback_has_no_address_for_others() -> None:
    assert list(urls_for_others("http://127.0.0.1:8080")) == []
    assert list(urls_for_others("http://[::1]:8080")) == []


def test_a_service_on_one_interface_has_that_address() -> None:
    assert list(urls_for_others("https://192.0.2.7:8080")) == ["https://192.0.2.7:8080"]
    assert list(urls_for_others("https://[2001:db8::7]:8080")) == ["https://[2001:db8::7]:8080"]


def test_a_service_on_all_interfaces_of_ipv4_has_no_address_of_ipv6() -> None:
    assert all("[" not in url for url in urls_for_others("http://0.0.0.0:8080"))


def test_the_terminal_shows_a_code_that_leads_to_the_page() -> None:
    addresses = [address for address in own_addresses() if address.version == 4]
    if not addresses:
        pytest.skip("this machine has no address but the loopback")
    compile_once()
    arguments = command("serve", "--insecure", "--host", "0.0.0.0", "--port", "0", "--zenoh-listen", free_endpoint())
    terminal, inside = pty.openpty()
    with subprocess.Popen(arguments, stdout=inside, stderr=subprocess.DEVNULL, env=environment()) as process:
        try:
            os.close(inside)
            printed = ""
            while "Scan the code" not in printed:
                printed += os.read(terminal, 65536).decode(errors="replace")
            first = next(line for line in printed.splitlines() if "for other devices" in line).split()[-1]
            assert first.startswith(f"http://{addresses[0]}:")
            assert scanned(printed) == first
        finally:
            process.terminate()
            assert process.wait(PATIENCE_S) == 0
            os.close(terminal)
