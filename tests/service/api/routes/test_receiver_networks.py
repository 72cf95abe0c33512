"""Networks of receivers that the page allows: at once, durably, and only where that does no harm."""

import ipaddress
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.delivery.addresses import RefusedAddressError, allowed
from dropanchor_service.delivery.channels import Channels
from dropanchor_service.delivery.event_parts import EventParts
from dropanchor_service.delivery.public_addresses import Network
from dropanchor_service.delivery.receiver_networks import AllowedNetwork, ReceiverNetworks, open_networks
from dropanchor_service.settings.events import DeliverySettings, EmailSettings, MqttSettings
from service.api.routes.test_zones_and_events import app_of
from support.api import ask, kind_of

NETWORKS = "/api/v1/receiver-networks"
MES = "/api/v1/destinations/mes"
HOOK = {"id": "mes", "type": "webhook", "url": "http://192.168.1.20:9/", "secret": examples.SECRET}


def parts_with(folder: Path | None = None, of_settings: Iterable[Network] = ()) -> EventParts:
    networks = ReceiverNetworks(of_settings, open_networks(folder))
    channels = Channels(DeliverySettings(), EmailSettings(), MqttSettings(), networks=networks)
    return replace(EventParts.in_memory("yard"), channels=channels)


def test_a_refused_receiver_names_the_network_that_lets_it_in_at_once() -> None:
    app = app_of(parts_with())
    refused = ask(app, "PUT", MES, json=HOOK)
    assert kind_of(refused) == "destination-refused"
    assert refused.json()["network"] == "192.168.1.0/24"
    assert "192.168.1.0/24 on the page" in refused.json()["detail"]
    assert ask(app, "PUT", f"{NETWORKS}/192.168.1.0%2F24").status_code == 200
    assert ask(app, "PUT", MES, json=HOOK).status_code == 200
    assert ask(app, "DELETE", f"{NETWORKS}/192.168.1.0%2F24").status_code == 204
    assert kind_of(ask(app, "PUT", MES, json=HOOK)) == "destination-refused"
    assert kind_of(ask(app, "DELETE", f"{NETWORKS}/192.168.1.0%2F24")) == "unknown-network"


def test_networks_of_the_settings_and_of_the_page_add_up_and_survive_a_restart(tmp_path: Path) -> None:
    of_settings = [ipaddress.ip_network("127.0.0.0/8")]
    app = app_of(parts_with(tmp_path, of_settings))
    ask(app, "PUT", f"{NETWORKS}/10.1.2.3%2F16").raise_for_status()
    restarted = parts_with(tmp_path, of_settings)
    assert ask(app_of(restarted), "GET", NETWORKS).json() == {
        "networks": [
            {"network": "127.0.0.0/8", "in_settings": True},
            {"network": "10.1.0.0/16", "in_settings": False},
        ]
    }
    assert allowed(["127.0.0.1", "10.1.255.1"], restarted.channels.networks) == "127.0.0.1"


@pytest.mark.parametrize(
    "network",
    [
        *("127.0.0.0/8", "127.0.0.1", "169.254.0.0/16", "169.254.169.254", "0.0.0.0/0", "93.184.216.0/24", "::/0"),
        *(
            "::1",
            "fe80::/10",
            "::ffff:127.0.0.1",
            "224.0.0.0/4",
            "100.100.100.200",
            "fd00:ec2::254",
            "fd00:ec2::/48",
            "fd00:c1::a9fe:a9fe",
            "fd00:a9fe:a9fe::1",
            "8.0.0.0/5",
        ),
    ],
)
def test_the_page_allows_neither_the_machine_itself_nor_its_link_nor_public_networks(network: str) -> None:
    app = app_of(parts_with())
    response = ask(app, "PUT", f"{NETWORKS}/{network.replace('/', '%2F')}")
    assert kind_of(response) == "invalid-request"
    assert "allow_networks" in response.json()["detail"]
    assert ask(app, "GET", NETWORKS).json() == {"networks": []}


@pytest.mark.parametrize("network", ["the-office", "fd00::%251%2F64"])
def test_what_is_no_network_is_refused_with_an_example(network: str) -> None:
    response = ask(app_of(parts_with()), "PUT", f"{NETWORKS}/{network}")
    assert response.json()["detail"] == "This is no network such as 192.168.1.0/24."


def test_a_wide_network_never_includes_the_metadata_service_of_a_cloud() -> None:
    networks = parts_with().channels.networks
    for text in ("100.64.0.0/10", "fc00::/7"):
        networks.items.put(text, AllowedNetwork(network=text))
    assert allowed(["100.100.100.201", "fd00:ec3::254"], networks) == "100.100.100.201"
    closed = ("100.100.100.200", "fd00:ec2::254", "fd20:ce::254", "fd00:42::42", "fd00:a9fe:a9fe::1")
    for address in (*closed, "fd00:c1::a9fe:a9fe", "fd00:100::100:200"):
        with pytest.raises(RefusedAddressError) as refused:
            allowed([address], networks)
        assert refused.value.network is None


def test_a_receiver_on_the_machine_itself_is_told_to_give_its_address_in_the_network() -> None:
    response = ask(app_of(parts_with()), "PUT", MES, json=HOOK | {"url": "http://127.0.0.1:9/"})
    assert "give the address that this machine has in your network" in response.json()["detail"]
    assert "network" not in response.json()


def test_without_access_control_no_other_machine_may_allow_a_network() -> None:
    app = app_of(parts_with())
    response = ask(app, "PUT", f"{NETWORKS}/10.0.0.0%2F8", address="10.0.0.7")
    assert kind_of(response) == "no-access-control"
    assert ask(app, "PUT", f"{NETWORKS}/10.0.0.0%2F8", address="::1").status_code == 200
