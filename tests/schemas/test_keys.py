"""The conversion between ids and key chunks, in both directions."""

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from dropanchor_schemas import keys

printable = st.text(min_size=1, max_size=64).filter(str.isprintable)
printable = printable.filter(lambda text: text not in keys.NOT_IDS)


@given(printable)
def test_every_id_survives_the_conversion_to_a_chunk(identifier: str) -> None:
    chunk = keys.chunk_from_id(identifier)
    assert keys.id_from_chunk(chunk) == identifier
    assert all(c.isascii() and (c.isalnum() or c in "._-%") for c in chunk)


@given(st.text(max_size=20))
def test_a_chunk_is_rejected_unless_it_is_the_escaped_form_of_an_id(chunk: str) -> None:
    try:
        identifier = keys.id_from_chunk(chunk)
    except keys.InvalidKeyError:
        return
    assert keys.chunk_from_id(identifier) == chunk


@given(printable, printable)
def test_every_key_of_a_tag_contains_its_id_and_is_a_valid_zenoh_key(site: str, tag: str) -> None:
    for key in (keys.samples_key(site, tag), keys.tag_alive_key(site, tag), keys.pose_key(site, tag)):
        assert keys.tag_from_key(key) == tag
        assert str(zenoh.KeyExpr(key)) == key
        leaf = key.rpartition("/")[2]
        assert zenoh.KeyExpr(keys.all_tags(site, leaf)).includes(zenoh.KeyExpr(key))


@given(st.text(max_size=60))
def test_any_text_is_a_tag_key_or_is_rejected(text: str) -> None:
    for key in (text, f"dropanchor/@v1/default/tag/{text}/samples"):
        try:
            tag = keys.tag_from_key(key)
        except keys.InvalidKeyError:
            continue
        assert keys.samples_key("default", tag) == key


@pytest.mark.parametrize("identifier", ["", "x" * 65, "a\nb", "\0", "\ud800", "\u200b", ".", ".."])
def test_an_invalid_id_is_rejected(identifier: str) -> None:
    with pytest.raises(keys.InvalidKeyError):
        keys.chunk_from_id(identifier)


@pytest.mark.parametrize(
    "chunk",
    ["", "%", "%2", "%zz", "%ff", "a b", "%61", "%2f", "*", "**", "@a", "~", "x" * 65, ".", "..", "%2E", "%2E%2E"],
)
def test_an_invalid_chunk_is_rejected(chunk: str) -> None:
    with pytest.raises(keys.InvalidKeyError):
        keys.id_from_chunk(chunk)


@pytest.mark.parametrize(
    "key",
    [
        "dropanchor/@v1/default/tag/a",
        "dropanchor/@v1/default/tag/a/b/samples",
        "dropanchor/@v2/default/tag/a/samples",
        "other/@v1/default/tag/a/samples",
        "dropanchor/@v1/default/anchor/a/samples",
        "/dropanchor/@v1/default/tag/a/samples",
    ],
)
def test_a_key_of_another_form_is_rejected(key: str) -> None:
    with pytest.raises(keys.InvalidKeyError, match="is not dropanchor/@v1/"):
        keys.tag_from_key(key)


@given(printable)
def test_anchor_and_service_keys_are_valid_zenoh_keys(identifier: str) -> None:
    assert zenoh.KeyExpr(keys.all_anchors("s")).includes(zenoh.KeyExpr(keys.anchor_key("s", identifier)))
    assert str(zenoh.KeyExpr(keys.service_alive_key("s", identifier))).endswith("/alive")
