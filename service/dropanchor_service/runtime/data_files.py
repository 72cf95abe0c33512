"""The names of what a service writes into its data folder."""

OF_SITE = (
    *("site.json*", "plans", "plans.json*", "history.sqlite*", "recordings", "events.sqlite*", "zones.json*"),
    *("event_rules.json*", "destinations.json*", "webhooks.json*", "receiver_networks.json*", "omlox_*.json*"),
)
"""Patterns of what belongs to one site, and moves with it."""
OF_SERVICE = (
    *OF_SITE,
    *("owner.lock", ".lock", "written_by", "site", "sites", "checkpoints", "share_key*", "share_links.json*"),
    *("kernels-*", "cluster", "blackbox"),
)
"""Patterns of all that a service writes there; the rest is somebody else's."""
