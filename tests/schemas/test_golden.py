"""The golden frames, against which the codecs of other languages are tested, are what the Python codec makes."""

from support.golden import FILE, document


def test_the_golden_file_is_current() -> None:
    assert FILE.read_text() == document(), "after a change of the contract: python tests/support/golden.py"
