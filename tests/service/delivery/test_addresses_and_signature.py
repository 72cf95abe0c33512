"""Receivers inside are refused however their address is written, and signatures follow Standard Webhooks."""

import base64
import hashlib
import hmac
import ipaddress

import pytest

from dropanchor_service.delivery.addresses import RefusedAddressError, UrlError, allowed, checked_url, resolved
from dropanchor_service.delivery.public_addresses import is_public
from dropanchor_service.delivery.signature import SecretError, headers, key_of

SECRET = f"whsec_{base64.b64encode(bytes(range(32))).decode()}"


@pytest.mark.parametrize(
    "url",
    [
        "http://127.0.0.1/",
        "http://localhost:8080/",
        "http://2130706433/",
        "http://0x7f.1/",
        "http://0/",
        "http://10.1.2.3/",
        "http://172.16.0.1/",
        "http://192.168.1.1/",
        "http://169.254.169.254/latest/meta-data",
        "http://168.63.129.16/",
        "http://100.64.0.1/",
        "http://224.0.0.1/",
        "http://[::1]/",
        "http://[::]/",
        "http://[fe80::1]/",
        "http://[fd00::1]/",
        "http://[::ffff:10.0.0.1]/",
        "http://[64:ff9b::a00:1]/",
        "http://[2002:a00:1::]/",
        "http://[ff02::1]/",
        "http://[::127.0.0.1]/",
        "http://[::ffff:0:127.0.0.1]/",
        "http://[64:ff9b:1::7f00:1]/",
        "http://[64:ff9b::c058:6301]/",
        "http://[fec0::1]/",
        "http://[2001::1]/",
        "http://[2001:db8::1]/",
        "http://[2002:5db8:d822::1]/",
        "http://[2620:4f:8000::1]/",
        "http://[3fff::1]/",
        "http://[5f00::1]/",
        "http://[100::1]/",
        "http://[4000::1]/",
        "http://192.0.0.9/",
        "http://192.31.196.1/",
        "http://192.52.193.1/",
        "http://192.88.99.1/",
        "http://192.175.48.1/",
        "http://198.18.0.1/",
        "http://203.0.113.1/",
        "http://240.0.0.1/",
        "http://255.255.255.255/",
    ],
)
def test_an_address_inside_is_refused(url: str) -> None:
    with pytest.raises(RefusedAddressError, match="allow_networks"):
        allowed(resolved(checked_url(url)), ())


@pytest.mark.parametrize(
    "address",
    [
        "93.184.216.34",
        "192.0.1.1",
        "223.255.255.255",
        "2606:2800:220:1::1",
        "2001:200::1",
        "::ffff:93.184.216.34",
        "64:ff9b::5db8:d822",
        "3ffe::1",
    ],
)
def test_an_address_on_the_internet_is_allowed(address: str) -> None:
    assert allowed([address], ()) == address


def test_what_python_knows_to_be_inside_is_inside() -> None:
    for address in (ipaddress.ip_address(number << 16) for number in range(2**16)):
        assert address.is_global or not is_public(address), address
    for address in (ipaddress.IPv6Address(number << 112) for number in range(2**16)):
        assert address.is_global or not is_public(address), address


def test_one_refused_address_among_several_is_enough() -> None:
    with pytest.raises(RefusedAddressError):
        allowed(["93.184.216.34", "10.0.0.1"], ())
    assert allowed(["93.184.216.34", "2606:2800:220:1::1"], ()) == "93.184.216.34"


def test_the_settings_allow_networks() -> None:
    networks = [ipaddress.ip_network("10.1.0.0/16"), ipaddress.ip_network("::1/128")]
    assert allowed(["10.1.2.3"], networks) == "10.1.2.3"
    assert allowed(["::1"], networks) == "::1"
    assert allowed(["::ffff:10.1.2.3"], networks) == "::ffff:10.1.2.3"
    with pytest.raises(RefusedAddressError):
        allowed(["10.2.0.1"], networks)


@pytest.mark.parametrize(
    "url",
    ["ftp://example.com/", "file:///etc/passwd", "example.com", "http://", "http://a:b@example.com/", "http://[::1"],
)
def test_a_url_that_is_none_or_holds_a_password_is_refused(url: str) -> None:
    with pytest.raises(UrlError):
        checked_url(url)


def test_the_signature_covers_id_time_and_body() -> None:
    found = headers(SECRET, "id-1", 1_800_000_000, b'{"a": 1}')
    digest = hmac.new(bytes(range(32)), b'id-1.1800000000.{"a": 1}', hashlib.sha256).digest()
    assert found["webhook-signature"] == f"v1,{base64.b64encode(digest).decode()}"
    assert (found["webhook-id"], found["webhook-timestamp"]) == ("id-1", "1800000000")


@pytest.mark.parametrize("secret", ["", "secret", "whsec_", "whsec_AAAA", SECRET.removeprefix("whsec_"), "whsec_ü" * 9])
def test_a_weak_secret_is_refused_without_repeating_it(secret: str) -> None:
    with pytest.raises(SecretError) as caught:
        key_of(secret)
    assert "New secret" in str(caught.value)
    assert len(secret) < 7 or secret not in str(caught.value)
