"""Networks inside whose machines may receive events: those of the settings, and those that the page allows.

The page allows private networks alone. What listens on the service's own machine, or on its link, often trusts whoever
reaches it, and in a cloud its metadata service gives away credentials: only the settings open those.
"""

import ipaddress
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict

from dropanchor_schemas.sentences import say
from dropanchor_service.delivery.public_addresses import Address, Network
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.store.items import NamedItems, adapter_of

FILE_NAME = "receiver_networks.json"
MAX_NETWORKS = 100

_PRIVATE = tuple(
    map(
        ipaddress.ip_network,  # RFC 1918, shared (RFC 6598), and unique local (RFC 4193)
        ("10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "100.64.0.0/10", "fc00::/7"),
    )
)
_METADATA = tuple(
    map(
        ipaddress.ip_network,  # of clouds, in private networks; most have 169.254.169.254, which is none
        (
            "fd00:ec2::/32",  # Amazon EC2: services of the link, https://docs.aws.amazon.com/AWSEC2/latest/UserGuide/
            "fd20:ce::254/128",  # Google Compute Engine, https://cloud.google.com/compute/docs/metadata/
            "fd00:42::42/128",  # Scaleway, https://www.scaleway.com/en/docs/instances/
            "fd00:a9fe:a9fe::1/128",  # Akamai, https://techdocs.akamai.com/cloud-computing/docs/metadata-service-api
            "fd00:c1::a9fe:a9fe/128",  # Oracle, https://docs.oracle.com/en-us/iaas/Content/Compute/Tasks/gettingmetadata.htm
            "100.100.100.200/32",  # Alibaba ECS, https://www.alibabacloud.com/help/en/ecs/user-guide/
            "fd00:100::100:200/128",
        ),
    )
)
_NO_NETWORK = say("no_network", "This is no network such as {example}", example="192.168.1.0/24")


def private_network(text: str) -> Network:
    """Return the network that a text such as `192.168.1.0/24` names. Raises ValueError, and says which it can."""
    try:
        network = ipaddress.ip_network(text.strip(), strict=False)
    except ValueError as error:
        raise ValueError(_NO_NETWORK) from error
    if "%" in text:  # the zone of one machine's link, which Python accepts
        raise ValueError(_NO_NETWORK)
    if not _can_be_allowed(network):
        raise ValueError(
            say(
                "network_not_private",
                "{network} is not private: the page can allow networks in {some} and {other}. For any "
                "other, set `allow_networks` in `[delivery]` of the settings",
                network=network,
                some="10.0.0.0/8, 172.16.0.0/12, 192.168.0.0/16, 100.64.0.0/10",
                other="fc00::/7",
            )
        )
    return network


def network_around(address: Address) -> Network | None:
    """Return the network of a receiver that the page can allow; None where only the settings can."""
    alone = ipaddress.ip_network(address)
    return alone.supernet(new_prefix=24 if address.version == 4 else 64) if _can_be_allowed(alone) else None


def _text_of(text: str) -> str:
    return str(private_network(text))


class AllowedNetwork(BaseModel):
    """A network as it is stored."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    network: Annotated[str, AfterValidator(_text_of)]


class ReceiverNetworks:
    """Yields all allowed networks, as they are at that moment. Any thread may use it."""

    def __init__(self, of_settings: Iterable[Network], items: NamedItems[AllowedNetwork] | None = None) -> None:
        """items: the networks that the page allows; by default, nothing stores them."""
        self.of_settings = tuple(of_settings)
        self.items = open_networks(None) if items is None else items

    def __iter__(self) -> Iterator[Network]:
        yield from self.of_settings
        for allowed in self.items.all.values():
            yield from _without_metadata(allowed.network)


def open_networks(folder: Path | None, recovery: Recovery | None = None) -> NamedItems[AllowedNetwork]:
    """Load the file. recovery: reports a file that is damaged. Raises NewerFileError."""
    path = None if folder is None else folder / FILE_NAME
    return NamedItems(adapter_of(AllowedNetwork), path, MAX_NETWORKS, recovery=recovery)


def _can_be_allowed(network: Network) -> bool:
    is_private = any(_is_within(network, private) for private in _PRIVATE)
    return is_private and not any(_is_within(network, metadata) for metadata in _METADATA)


@lru_cache(MAX_NETWORKS)
def _without_metadata(text: str) -> Sequence[Network]:
    """Return the parts of a network that hold no metadata service."""
    parts: list[Network] = [ipaddress.ip_network(text)]
    for metadata in _METADATA:
        parts = [
            kept for part in parts for kept in (_excluding(part, metadata) if _is_within(metadata, part) else [part])
        ]
    return tuple(parts)


def _excluding(network: Network, inner: Network) -> Iterator[Network]:
    assert isinstance(network, ipaddress.IPv4Network) == isinstance(inner, ipaddress.IPv4Network)
    return network.address_exclude(inner)  # type: ignore[arg-type]


def _is_within(inner: Network, outer: Network) -> bool:
    return inner.version == outer.version and outer.supernet_of(inner)  # type: ignore[arg-type]
