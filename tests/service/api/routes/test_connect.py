"""The connection details for tags. Only clients on the machine itself get the path of the program."""

import subprocess
import sysconfig
from pathlib import Path

import pytest

from dropanchor_service.settings.model import ZenohSettings
from dropanchor_service.zenoh_io.endpoints import endpoints_of
from support.api import ask, make_api_bench

SCRIPTS = sysconfig.get_path("scripts")


def test_a_browser_on_this_machine_gets_the_path_of_the_program() -> None:
    app = make_api_bench().app(endpoints=("tcp/0.0.0.0:19747",))
    answer = ask(app, "GET", "/api/v1/connect", headers={"host": "127.0.0.1:8080"}).json()
    assert answer["endpoints"] == ["tcp/127.0.0.1:19747"]
    assert not answer["credentials"]
    program, rest = answer["simulate"].split(" simulate ")
    assert rest == "--connect tcp/127.0.0.1:19747 --anchor 17"
    done = subprocess.run(["sh", "-c", f"{program} --help"], check=True, capture_output=True, text=True)
    assert "dropanchor-tag" in done.stdout


def test_what_a_router_is_told_after_its_endpoint_is_not_shown() -> None:
    app = make_api_bench().app(endpoints=("tls/yard.example:7447#listen_private_key_base64=c2VjcmV0",))
    answer = ask(app, "GET", "/api/v1/connect").json()
    assert answer["endpoints"] == ["tls/yard.example:7447"]
    assert "c2VjcmV0" not in answer["simulate"]


@pytest.mark.parametrize(
    ("address", "headers"),
    [
        ("192.0.2.9", {"host": "yard.example:8080"}),
        ("192.0.2.9", {"host": "127.0.0.1"}),
        ("127.0.0.1", {"host": "yard.example"}),
        ("127.0.0.1", {"host": "127.0.0.1", "x-forwarded-for": "192.0.2.9"}),
        ("127.0.0.1", {"host": "127.0.0.1", "forwarded": "for=192.0.2.9"}),
    ],
)
def test_other_clients_get_no_path_of_this_machine(address: str, headers: dict[str, str]) -> None:
    app = make_api_bench().app(endpoints=("tcp/0.0.0.0:19747", "tcp/[::]:19748"))
    response = ask(app, "GET", "/api/v1/connect", address, headers=headers)
    assert SCRIPTS not in response.text
    name = headers["host"].partition(":")[0]
    assert response.json()["endpoints"] == [f"tcp/{name}:19747", f"tcp/{name}:19748"]
    assert response.json()["simulate"] == f"dropanchor-tag simulate --connect tcp/{name}:19747 --anchor 17"


def test_endpoints_of_an_external_router_and_of_a_configuration_file_are_listed(tmp_path: Path) -> None:
    assert endpoints_of(ZenohSettings(connect=("tcp/192.0.2.1:7447",)), None) == ("tcp/192.0.2.1:7447",)
    file = tmp_path / "zenoh.json5"
    file.write_text('{mode: "router", listen: {endpoints: ["tcp/127.0.0.1:19999"]}}')
    assert endpoints_of(ZenohSettings(config_file=file), None) == ("tcp/127.0.0.1:19999",)
    file.write_text('{mode: "client", connect: {endpoints: ["tcp/192.0.2.1:19998"]}}')
    assert endpoints_of(ZenohSettings(config_file=file), None) == ("tcp/192.0.2.1:19998",)
