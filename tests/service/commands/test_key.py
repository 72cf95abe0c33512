"""`dropanchor key add` for a phone: a link and its QR code."""

from pathlib import Path

import numpy as np
import pytest
import zxingcpp

from dropanchor_service.cli import main
from dropanchor_service.security.api_keys import ApiKeys
from support.secured import secured_site

HALVES = {" ": (0, 0), "▀": (1, 0), "▄": (0, 1), "█": (1, 1)}  # upper and lower; a drawn half is light


def scanned(printed: str) -> str:
    """Return what a scanner reads from the code that a terminal with a dark ground shows."""
    rows = [line for line in printed.splitlines() if line and set(line) <= set(HALVES)]
    light = np.array([[HALVES[c][half] for c in row] for row in rows for half in (0, 1)], np.uint8)
    image = np.kron(255 * light, np.ones((8, 8), np.uint8))
    read = zxingcpp.read_barcodes(image)
    found = [code.text for code in read if code.format == zxingcpp.BarcodeFormat.QRCode]  # chance makes other kinds
    assert len(found) == 1
    return str(found[0])


def add(folder: Path, *words: str) -> int:
    return main(["key", "add", *words, "--security", str(folder)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return secured_site(tmp_path / "security").folder.path


@pytest.mark.parametrize("url", ["https://yard.example:8080", "https://yard.example:8080/"])
def test_the_code_holds_the_link_with_the_key_after_the_hash(
    folder: Path, capsys: pytest.CaptureFixture[str], url: str
) -> None:
    assert add(folder, "phone", "--tag", "anna's cart", "--url", url) == 0
    printed = capsys.readouterr()
    secret = printed.out.strip()
    link = f"https://yard.example:8080/tag/#tag=anna%27s%20cart&key={secret}"
    assert scanned(printed.err) == link
    assert f"or open: {link}\n" in printed.err
    assert ApiKeys(folder).identify(secret).tag == "anna's cart"


def test_the_code_for_phyphox_loads_the_experiment(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert add(folder, "phone", "--tag", "anna's cart", "--url", "https://yard.example:8080/base/", "--phyphox") == 0
    printed = capsys.readouterr()
    secret = printed.out.strip()
    link = f"phyphox://yard.example:8080/base/api/v1/ingest/phyphox?tag=anna%27s%20cart&token={secret}"
    assert scanned(printed.err) == link
    assert f"open on the phone: {link}\n" in printed.err


def test_a_link_without_https_says_that_phones_give_no_motion(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert add(folder, "phone", "--tag", "anna", "--url", "http://localhost:8080") == 0
    assert "https:// only" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--url", "https://yard.example"], "--url needs --tag"),
        (["--tag", "anna", "--phyphox"], "--phyphox needs --url"),
        (["--tag", "anna", "--url", "yard.example:8080"], "give the address of the page"),
        (["--tag", "anna", "--url", "https://yard.example/#x"], "give the address of the page"),
    ],
)
def test_no_key_is_made_where_no_link_can_be_shown(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], sentence: str
) -> None:
    assert add(folder, "phone", *words) == 2
    assert sentence in capsys.readouterr().err
    assert not ApiKeys(folder).all()
