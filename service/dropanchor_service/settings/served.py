"""Which of the sites in the settings a process serves."""

from dropanchor_service.settings.buckets import bucket_of, buckets_in
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.sources import SettingsError


def served_settings(settings: Settings) -> Settings:
    """Return the settings with the sites of the bucket that they name. Raise SettingsError if they leave it open."""
    cluster = settings.cluster
    if cluster.url is None:
        return settings
    if cluster.bucket is None:
        known = ", ".join(buckets_in(settings.site_ids))
        raise SettingsError(
            f"cluster.bucket: say which bucket this process serves ({known}), or let `dropanchor cluster start` do it"
        )
    return settings_of_bucket(settings, cluster.bucket)


def settings_of_bucket(settings: Settings, bucket: str) -> Settings:
    """Return the settings with the sites of one bucket. Sites without a bucket in their ids all stay."""
    sites = settings.sites
    if buckets_in(sites):
        sites = {name: site for name, site in sites.items() if bucket_of(name) == bucket}
    cluster = settings.cluster.model_copy(update={"bucket": bucket})
    return settings.model_copy(update={"cluster": cluster, "sites": sites})
