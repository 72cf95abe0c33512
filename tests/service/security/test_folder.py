"""The folder of credentials: what it issues, and what it refuses."""

import json
import stat
import subprocess
import sys
from datetime import timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from dropanchor_service.cli import main
from dropanchor_service.security.access_control import ROLES
from dropanchor_service.security.credentials import credentials_of
from dropanchor_service.security.folder import SecurityError, SecurityFolder
from dropanchor_service.settings.model import SecuritySettings, Settings
from dropanchor_tag_client import read_credentials
from support.commands import environment
from support.patience import PATIENCE_S
from support.secured import secured_site


def modes(folder: Path) -> dict[str, int]:
    return {file.name: stat.S_IMODE(file.stat().st_mode) for file in folder.rglob("*") if file.is_file()}


def test_init_prints_the_next_steps_and_never_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "security"
    init = ["security", "init", "--security", str(folder), "--host", "yard.example", "--host", "192.0.2.7"]
    assert main(init) == 0
    output = capsys.readouterr().out
    assert "dropanchor tag add NAME" in output
    assert "dropanchor router --security" in output
    before = {file.name: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
    assert main(init) == 2
    assert "never overwritten" in capsys.readouterr().err
    assert {file.name: file.read_bytes() for file in folder.rglob("*") if file.is_file()} == before


@pytest.mark.parametrize(
    ("listen", "connect"),
    [("tls/0.0.0.0:19747", "tls/localhost:19747"), ("tls/192.0.2.7:19748", "tls/192.0.2.7:19748")],
)
def test_the_next_steps_name_the_requested_endpoint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], listen: str, connect: str
) -> None:
    assert main(["security", "init", "--security", str(tmp_path / "s"), "--host", "192.0.2.7", "--listen", listen]) == 0
    output = capsys.readouterr().out
    assert f"--zenoh-connect {connect}" in output
    assert "7447" not in output


def test_only_the_owner_can_read_private_keys(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security", "a")
    found = modes(site.folder.path)
    assert {name for name, mode in found.items() if mode == 0o600} >= {name for name in found if name.endswith(".key")}
    assert sum(name.endswith(".key") for name in found) == len(ROLES) + 2
    assert stat.S_IMODE(site.folder.path.stat().st_mode) == 0o700


def test_certificates_name_their_hosts_and_their_purpose(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security", "a")
    authority = x509.load_pem_x509_certificate(site.folder.certificate("ca").read_bytes())
    router = x509.load_pem_x509_certificate(site.folder.certificate("router").read_bytes())
    tag = x509.load_pem_x509_certificate((site.folder.bundle("a") / "tag.pem").read_bytes())
    for certificate in (router, tag):
        certificate.verify_directly_issued_by(authority)
    names = router.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["localhost"]
    assert [str(address) for address in names.get_values_for_type(x509.IPAddress)] == ["127.0.0.1"]
    assert not tag.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    usage = list(tag.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)
    assert usage == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert tag.subject.rfc4514_string() == "CN=a"


def test_a_bundle_says_who_the_tag_is_and_where_it_connects(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security", "a/ü", site="yard")
    credentials = read_credentials(site.folder.bundle("a/ü"))
    assert (credentials.tag, credentials.site, credentials.session.connect) == ("a/ü", "yard", site.endpoint)


def test_tags_are_added_listed_and_revoked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = ["--security", str(secured_site(tmp_path / "security").folder.path)]
    assert main(["tag", "add", "a", "b", *folder]) == 0
    assert main(["tag", "revoke", "a", *folder]) == 0
    assert "Restart the router" in capsys.readouterr().out
    assert main(["tag", "list", *folder]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("\t")[:2][0] for line in lines] == ["a", "b"]
    assert "revoked" in lines[0]
    assert "admitted" in lines[1]
    configuration = json.loads((tmp_path / "security" / "router.json5").read_text())
    assert [subject["id"] for subject in configuration["access_control"]["subjects"]] == ["service", "reader", "b"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["tag", "add", "service"], "is a reserved name"),
        (["tag", "add", "x" * 65], "1 to 64 characters"),
        (["tag", "add", "ü" * 33], "a name may have 64 bytes"),
        (["tag", "add", "--", ".."], "'..' cannot be an id"),
        (["tag", "add", "."], "'.' cannot be an id"),
        (["tag", "add", "nul"], "on Windows it is a device"),
        (["security", "add-site", ".."], "'..' cannot be an id"),
        (["security", "add-site", "con"], "on Windows it is a device"),
        (["tag", "add", "known"], "replace it with --renew"),
        (["tag", "add", "new", "--renew"], "no certificate to renew"),
        (["tag", "add", "gone"], "would also admit its old certificate"),
        (["tag", "revoke", "nobody"], "'nobody' has no certificate"),
        (["tag", "revoke", "gone"], "is revoked already"),
    ],
)
def test_a_request_that_cannot_be_met_is_refused_with_a_reason(
    tmp_path: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = secured_site(tmp_path / "security", "known", "gone").folder
    folder.revoke_tag("gone")
    before = sorted(folder.path.rglob("*"))
    assert main([*arguments[:2], "--security", str(folder.path), *arguments[2:]]) == 2
    assert sorted(folder.path.rglob("*")) == before
    assert words in capsys.readouterr().err


def test_a_missing_or_damaged_folder_is_named_in_the_error(tmp_path: Path) -> None:
    with pytest.raises(SecurityError, match="dropanchor security init"):
        SecurityFolder.open(tmp_path)
    (tmp_path / "issued.json").write_text("{")
    with pytest.raises(SecurityError, match=r"issued\.json is damaged"):
        SecurityFolder.open(tmp_path)


def test_the_key_of_the_authority_may_be_kept_elsewhere_until_it_is_needed(tmp_path: Path) -> None:
    folder = secured_site(tmp_path / "security", "a").folder
    folder.key("ca").unlink()
    folder.revoke_tag("a")
    with pytest.raises(SecurityError, match="the authority's certificate and key are needed"):
        folder.add_tag("b", 30)


def test_tags_added_by_concurrent_processes_are_all_kept(tmp_path: Path) -> None:
    path = secured_site(tmp_path / "security").folder.path
    commands = [
        [sys.executable, "-m", "dropanchor_service", "tag", "add", f"t{n}", "--security", str(path)] for n in range(4)
    ]
    running = [subprocess.Popen(command, env=environment(), stdout=subprocess.DEVNULL) for command in commands]
    assert [process.wait(PATIENCE_S) for process in running] == [0] * 4
    assert sorted(SecurityFolder.open(path).table.tags) == ["t0", "t1", "t2", "t3"]


@pytest.mark.parametrize("host", ["", "a b", "yard.example:7447", "tls/yard"])
def test_an_invalid_host_is_refused(tmp_path: Path, host: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["security", "init", "--security", str(tmp_path / "s"), "--host", host]) == 2
    assert "neither the name nor the address" in capsys.readouterr().err


def test_renewal_keeps_the_authority_and_adds_the_new_host(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = secured_site(tmp_path / "security", "a").folder
    before = folder.certificate("router").read_bytes()
    assert folder.expiring(timedelta(days=29)) == []
    soon = folder.expiring(timedelta(days=31))
    assert [sentence.rpartition("/")[2].split()[0] for sentence in soon[:3]] == [
        "service.pem",
        "reader.pem",
        "router.pem",
    ]
    assert soon[3].startswith("the certificate of tag 'a' expires on")
    assert main(["security", "renew", "--security", str(folder.path), "--host", "new.example", "--days", "99"]) == 0
    assert "new.example" in capsys.readouterr().out
    renewed = x509.load_pem_x509_certificate(folder.certificate("router").read_bytes())
    renewed.verify_directly_issued_by(x509.load_pem_x509_certificate(folder.certificate("ca").read_bytes()))
    names = renewed.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["localhost", "new.example"]
    assert folder.certificate("router").read_bytes() != before
    assert len(SecurityFolder.open(folder.path).expiring(timedelta(days=31))) == 1


def test_the_service_warns_at_its_start_about_certificates_that_expire_soon(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = secured_site(tmp_path / "security", "a").folder
    folder.renew([], days=3)
    credentials_of(Settings(security=SecuritySettings(folder=folder.path)))
    assert "service.pem expires on" in caplog.text
    assert "dropanchor security renew" in caplog.text
