"""Zenoh's access control for the sites of a router. It lists who may send what on which keys, and denies all else.

Zenoh rules have no placeholder for the name of the client, so every tag gets its own rules. Publishers that recover
lost messages keep their caches under the verbatim chunk `@adv`. `**` does not match it, so it is listed separately.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from dropanchor_schemas import keys
from dropanchor_schemas.health import MAX_HEALTH_BYTES

SERVICE, READER, ROUTER = "service", "reader", "router"
ROLES = (SERVICE, READER, ROUTER)
"""Common names that are reserved: no tag may use them."""

MAX_SAMPLES_BYTES = 16_384  # 50 samples take about 8 kB as JSON
_OVERHEAD_BYTES = 1_024

_RECOVERY = ["query", "declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]
_EVERYTHING = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
]

Section = dict[str, Any]


class Holder(NamedTuple):
    """A tag that has a certificate. name: the common name of the certificate."""

    name: str
    site: str
    tag: str


def reader_of(site: str) -> str:
    """Return the common name of the certificate that reads this site and no other."""
    return f"{READER}/{site}"


def access_control(sites: Sequence[str], tags: Iterable[Holder]) -> Section:
    """Return the section `access_control` of a router's configuration.

    With several sites, `service` and `reader` are for all of them, and each site has a reader of its own.
    """
    shared = sites[0] if len(sites) == 1 else None
    by_name = {SERVICE: _service(shared), READER: _reader(shared, "readers")}
    if shared is None:
        by_name |= {reader_of(site): _reader(site, f"readers of {site}") for site in sites}
    by_name |= {holder.name: _tag(holder, shared) for holder in tags}
    rules = [rule for subject_rules in by_name.values() for rule in subject_rules]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in by_name],
        "policies": [
            {"rules": [rule["id"] for rule in subject_rules], "subjects": [name]}
            for name, subject_rules in by_name.items()
        ],
    }


def low_pass_filter(sites: Sequence[str]) -> list[Section]:
    """Return the section `low_pass_filter`, which limits the size of the messages of tags."""
    shared = sites[0] if len(sites) == 1 else None
    samples = _all_tags(shared, "samples")
    return [
        {
            "id": "health",
            "flows": ["ingress"],
            "messages": ["put", "delete"],
            "key_exprs": [_all_tags(shared, "health")],
            "size_limit": MAX_HEALTH_BYTES + _OVERHEAD_BYTES,
        },
        {
            "id": "samples",
            "flows": ["ingress"],
            "messages": ["put", "delete", "query", "reply"],
            "key_exprs": [samples, f"{samples}/@adv/**"],
            "size_limit": MAX_SAMPLES_BYTES,
        },
    ]


def _all_tags(site: str | None, leaf: str) -> str:
    """Return the key expression of `leaf` of every tag of a site; None: of all sites."""
    return keys.all_sites(leaf) if site is None else keys.all_tags(site, leaf)


def _tag(holder: Holder, shared: str | None) -> list[Section]:
    """Return the rules of a tag. shared: the only site of the router; None: it has several."""
    name, site, tag = holder
    samples, alive, pose = keys.samples_key(site, tag), keys.tag_alive_key(site, tag), keys.pose_key(site, tag)
    to_tag = [pose, keys.settings_key(site, tag), keys.all_anchors(site)]
    # A service with several sites asks for the samples of all of them at once. These queries hold no data.
    asked = [keys.all_tags(site, "samples"), *([] if shared else [keys.all_sites("samples")])]
    own = [samples, f"{samples}/@adv/**"]
    return [
        _rule(f"{name}: puts its samples", "ingress", ["put"], own),
        _rule(f"{name}: reports its health", "ingress", ["put"], [keys.health_key(site, tag)]),
        _rule(f"{name}: declares its liveliness", "ingress", ["liveliness_token"], [alive, f"{samples}/@adv/**"]),
        _rule(f"{name}: answers from its cache", "ingress", ["declare_queryable", "reply"], own),
        _rule(
            f"{name}: receives queries to its cache",
            "egress",
            _RECOVERY,
            [*asked, *(f"{key}/@adv/**" for key in asked), *own],
        ),
        _rule(f"{name}: requests its pose and settings", "ingress", ["query", "declare_subscriber"], to_tag),
        _rule(f"{name}: receives its pose and settings", "egress", ["put", "reply"], to_tag),
    ]


def _service(site: str | None) -> list[Section]:
    everything = keys.everything_of_all_sites() if site is None else keys.everything(site)
    below = [everything, f"{_all_tags(site, 'samples')}/@adv/**", keys.owners_of_all_buckets()]
    return [_rule("the service", "both", _EVERYTHING, below)]


def _reader(site: str | None, who: str) -> list[Section]:
    of_all = [keys.poses_of_all_sites(), keys.anchors_of_all_sites()]
    of_site = of_all if site is None else [keys.poses_key(site), keys.all_anchors(site)]
    poses = [_all_tags(site, "pose"), _all_tags(site, "event"), *of_site]
    services = keys.services_of_all_sites() if site is None else keys.all_services_alive(site)
    alive = [_all_tags(site, "alive"), services]
    liveliness = ["liveliness_query", "declare_liveliness_subscriber"]
    return [
        _rule(f"{who} request poses", "ingress", ["query", "declare_subscriber"], poses),
        _rule(f"{who} receive poses", "egress", ["put", "reply", "declare_queryable"], poses),
        _rule(f"{who} request liveliness", "ingress", liveliness, alive),
        _rule(f"{who} receive liveliness", "egress", ["liveliness_token", "reply"], alive),
    ]


def _rule(name: str, flow: str, messages: list[str], key_exprs: list[str]) -> Section:
    flows = ["ingress", "egress"] if flow == "both" else [flow]
    return {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": key_exprs}
