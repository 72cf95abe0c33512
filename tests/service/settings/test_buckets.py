"""The ids of clustered sites begin with their bucket, and a process serves and asks for the sites of one bucket."""

import pytest
import zenoh

from dropanchor_schemas import keys
from dropanchor_service.persistence.site import open_sites
from dropanchor_service.settings.buckets import bucket_of, buckets_in
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.served import served_settings
from dropanchor_service.settings.sources import SettingsError, load_settings

URL = "postgresql://dropanchor@db.example/dropanchor"


def clustered(*sites: str, bucket: str | None = None) -> Settings:
    cluster = {"url": URL} | ({} if bucket is None else {"bucket": bucket})
    return load_settings(options={"cluster": cluster, "sites": {site: {} for site in sites}}, environment={})


@pytest.mark.parametrize(
    ("site", "bucket"),
    [
        ("017.yard", "017"),
        ("017.a.b", "017"),
        ("17.yard", None),
        ("0017.yard", None),
        ("017yard", None),
        ("017.", None),
    ],
)
def test_a_bucket_is_three_digits_before_a_dot(site: str, bucket: str | None) -> None:
    assert bucket_of(site) == bucket


def test_a_process_serves_the_sites_of_its_bucket_and_their_keys_alone() -> None:
    settings = clustered("018.b", "017.a", "017.Süd", bucket="017")
    assert buckets_in(settings.site_ids) == ["017", "018"]
    own = open_sites(served_settings(settings))
    assert [site.id for site in own] == ["017.a", "017.Süd"]
    samples = zenoh.KeyExpr(own.all_tags("samples"))
    assert all(samples.includes(keys.samples_key(site.id, "cart")) for site in own)
    assert not samples.intersects(keys.samples_key("018.b", "cart"))
    one = open_sites(served_settings(clustered("018.b", "017.a", bucket="018")))
    assert one.all_tags("samples") == keys.all_tags("018.b", "samples")


def test_sites_without_buckets_are_all_in_the_one_that_is_named() -> None:
    settings = clustered("north", "south", bucket="yards")
    assert len(open_sites(served_settings(settings))) == 2
    assert open_sites(settings).all_tags("samples") == keys.all_sites("samples")


@pytest.mark.parametrize(
    ("sites", "bucket", "sentence"),
    [
        (["017.a", "b"], "017", "some ids of sites have a bucket, but 'b' has none: give each id its bucket"),
        (["017.a", "018.b"], "019", "cluster.bucket is '019', but the sites have the buckets 017, 018"),
        (["a", "b"], None, "name the sites of this process with cluster.bucket, or give each id its bucket"),
    ],
)
def test_buckets_that_cannot_be_are_refused(sites: list[str], bucket: str | None, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        clustered(*sites, bucket=bucket)


def test_serve_wants_to_know_the_bucket() -> None:
    with pytest.raises(SettingsError, match=r"say which bucket this process serves \(017, 018\)"):
        served_settings(clustered("017.a", "018.b"))
