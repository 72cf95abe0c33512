"""A secured site, from the first command to a pose: certificates, access control, API keys, HTTPS."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from dropanchor_service.cli import main
from dropanchor_tag_client import TagClient, read_credentials
from support.patience import PATIENCE_S
from support.service import ended, running_router, running_service, straight_north
from support.zenoh_router import free_port, wait_until


class Site:
    """A site whose credentials are made by the commands of an operator."""

    def __init__(self, path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.path = path
        self.port = free_port()
        self._capsys = capsys
        listen = f"tls/127.0.0.1:{self.port}"
        self.run("security", "init", "--host", "localhost", "--listen", listen)
        self.endpoint = f"tls/localhost:{self.port}"

    def run(self, *words: str) -> str:
        """Run a subcommand of `dropanchor`. Return its output."""
        self._capsys.readouterr()
        assert main([*words, "--security", str(self.path)]) == 0
        return self._capsys.readouterr().out.strip()

    def router(self) -> AbstractContextManager[None]:
        return running_router("--security", str(self.path))

    @contextmanager
    def tag(self, name: str) -> Iterator[TagClient]:
        credentials = read_credentials(self.path / "tags" / name)
        with TagClient(
            credentials.tag, site=credentials.site, connect=credentials.session, connect_timeout_s=PATIENCE_S
        ) as client:
            yield client


@pytest.fixture
def site(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Site:
    return Site(tmp_path / "security", capsys)


def send(client: TagClient) -> None:
    for sample in straight_north(5).ranges:
        client.publish_range(7, sample.range_m, t_ns=sample.t_ns)
    client.flush()


def test_keys_and_certificates_give_access_until_they_are_revoked(site: Site) -> None:
    site.run("tag", "add", "cart")
    reading, writing = (f"Bearer {site.run('key', 'add', scope, '--scope', scope)}" for scope in ("read", "write"))
    with site.router():
        arguments = ("--security", str(site.path), "--zenoh-connect", site.endpoint, "--log-level", "DEBUG")
        with running_service(*arguments, ca=site.path / "ca.pem") as service:
            assert service.url.startswith("https://")
            assert service.ask("GET", "/api/v1/tags").status_code == 401
            guess = "Bearer dropanchor_00000000_a-guess-that-was-sent"
            assert service.ask("GET", "/api/v1/tags", headers={"authorization": guess}).status_code == 401
            put = service.ask("PUT", "/api/v1/tags/cart/settings", headers={"authorization": writing}, json={})
            assert put.status_code == 200

            def messages() -> int:
                answer = service.ask("GET", "/api/v1/tags/cart", headers={"authorization": reading})
                return int(answer.json()["messages"])

            with site.tag("cart") as cart:
                send(cart)
                wait_until(lambda: messages() > 0)
            site.run("key", "revoke", "read")
            wait_until(
                lambda: service.ask("GET", "/api/v1/tags", headers={"authorization": reading}).status_code == 401
            )
            assert service.stop() == 0
    log = "".join(service.log)
    assert "ready at https://" in log
    for secret in (reading, writing, guess):
        assert secret.split("_", 2)[2] not in log  # the last part may hold an underscore of its own


def test_a_service_with_its_own_router_admits_only_tags_with_valid_credentials(site: Site) -> None:
    site.run("tag", "add", "known", "revoked")
    site.run("tag", "revoke", "revoked")
    key = {"authorization": f"Bearer {site.run('key', 'add', 'all', '--scope', 'admin')}"}
    arguments = ("--security", str(site.path), "--zenoh-listen", f"tls/127.0.0.1:{site.port}")
    with (
        running_service(*arguments, ca=site.path / "ca.pem") as service,
        site.tag("revoked") as revoked,
        site.tag("known") as known,
    ):

        def admitted() -> list[str]:
            send(revoked)
            send(known)
            tags = service.ask("GET", "/api/v1/tags", headers=key).json()["tags"]
            return [tag["tag"] for tag in tags if tag["messages"] > 3]

        wait_until(admitted)
        assert admitted() == ["known"]


def test_an_invalid_certificate_is_reported_in_one_sentence(site: Site) -> None:
    (site.path / "service.key").write_text("no key")
    result = ended("serve", "--port", "0", "--security", str(site.path), "--zenoh-connect", site.endpoint)
    assert result.returncode == 2
    assert "cannot serve HTTPS" in result.stderr
    assert "Traceback" not in result.stderr
