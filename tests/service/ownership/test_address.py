"""Where API nodes reach a shard."""

import socket

import pytest

from dropanchor_service.ownership.address import address_of
from dropanchor_service.settings.model import Settings


@pytest.mark.parametrize(
    ("host", "address", "url", "expected"),
    [
        ("127.0.0.1", None, "http://127.0.0.1:41001", "http://127.0.0.1:41001"),
        ("10.0.0.5", None, "https://10.0.0.5:41001", "https://10.0.0.5:41001"),
        ("0.0.0.0", None, "http://0.0.0.0:41001", f"http://{socket.gethostname()}:41001"),
        ("0.0.0.0", "http://machine-1.example", "https://0.0.0.0:41001", "https://machine-1.example:41001"),
        ("::", "http://[fd00::5]:8080", "http://[::]:41001", "http://[fd00::5]:41001"),
    ],
)
def test_a_shard_is_reached_at_its_machine_and_its_own_port(
    host: str, address: str | None, url: str, expected: str
) -> None:
    settings = Settings.model_validate(
        {"http": {"host": host}, "cluster": {"url": "postgresql://db/x", "bucket": "yard", "address": address}}
    )
    assert address_of(settings, url) == expected
