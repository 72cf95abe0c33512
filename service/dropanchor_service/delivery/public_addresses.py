"""Which addresses lie on the public internet: global unicast, less every block with a special purpose.

Python's own table depends on its version, and counts much as global that is not. This one is ours: the IANA IPv4 and
IPv6 Special-Purpose Address Registries (RFC 6890), IPv4 as of 2020-09-04 and IPv6 as of 2025-10-09. Blocks that IANA
calls globally reachable are refused, too: no receiver has an anycast address of a protocol.
"""

import ipaddress

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
Address = ipaddress.IPv4Address | ipaddress.IPv6Address

_SPECIAL_V4 = (
    *("0.0.0.0/8", "10.0.0.0/8", "100.64.0.0/10", "127.0.0.0/8", "169.254.0.0/16", "172.16.0.0/12", "192.0.0.0/24"),
    *("192.0.2.0/24", "192.31.196.0/24", "192.52.193.0/24", "192.88.99.0/24", "192.168.0.0/16", "192.175.48.0/24"),
    *("198.18.0.0/15", "198.51.100.0/24", "203.0.113.0/24", "240.0.0.0/4"),
    "224.0.0.0/4",  # multicast: RFC 5771
    "168.63.129.16/32",  # Azure's own: https://learn.microsoft.com/azure/virtual-network/what-is-ip-address-168-63-129-16
)
# Only 2000::/3 is assigned as global unicast (RFC 4291); the rest of the registry lies outside it.
_GLOBAL_UNICAST_V6 = ipaddress.IPv6Network("2000::/3")
_SPECIAL_V6 = ("2001::/23", "2001:db8::/32", "2002::/16", "2620:4f:8000::/48", "3fff::/20")
_NAT64 = ipaddress.IPv6Network("64:ff9b::/96")  # RFC 6052: how a host with IPv6 alone reaches an IPv4 address

_REFUSED_V4 = tuple(map(ipaddress.IPv4Network, _SPECIAL_V4))
_REFUSED_V6 = tuple(map(ipaddress.IPv6Network, _SPECIAL_V6))


def address_of(text: str) -> Address:
    """Return the address in a text without its zone. One of IPv4 that is written as IPv6 is that of IPv4."""
    address = ipaddress.ip_address(text.partition("%")[0])
    return getattr(address, "ipv4_mapped", None) or address


def is_public(address: Address) -> bool:
    """Return whether the address lies on the public internet."""
    if isinstance(address, ipaddress.IPv4Address):
        return not any(address in network for network in _REFUSED_V4)
    if address in _NAT64:
        return is_public(ipaddress.IPv4Address(int(address) & 0xFFFFFFFF))
    return address in _GLOBAL_UNICAST_V6 and not any(address in network for network in _REFUSED_V6)
