"""Zenoh's access control for one site. It lists who may send what on which keys, and denies everything else.

Zenoh rules have no placeholder for the name of the client, so every tag gets its own rules. Publishers that recover
lost messages keep their caches under the verbatim chunk `@adv`. `**` does not match it, so it is listed separately.
"""

from collections.abc import Iterable
from typing import Any

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


def access_control(site: str, tags: Iterable[str]) -> Section:
    """Return the section `access_control` of a router's configuration.

    tags: the ids of the tags, which are also the common names of their certificates.
    """
    by_name = {SERVICE: _service(site), READER: _reader(site)}
    by_name |= {tag: _tag(site, tag) for tag in tags}
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


def low_pass_filter(site: str) -> list[Section]:
    """Return the section `low_pass_filter`, which limits the size of the messages of tags."""
    samples = keys.all_tags(site, "samples")
    return [
        {
            "id": "health",
            "flows": ["ingress"],
            "messages": ["put", "delete"],
            "key_exprs": [keys.all_tags(site, "health")],
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


def _tag(site: str, tag: str) -> list[Section]:
    samples, alive, pose = keys.samples_key(site, tag), keys.tag_alive_key(site, tag), keys.pose_key(site, tag)
    to_tag = [pose, keys.settings_key(site, tag), keys.all_anchors(site)]
    all_samples = keys.all_tags(site, "samples")
    own = [samples, f"{samples}/@adv/**"]
    return [
        _rule(f"{tag}: puts its samples", "ingress", ["put"], own),
        _rule(f"{tag}: reports its health", "ingress", ["put"], [keys.health_key(site, tag)]),
        _rule(f"{tag}: declares its liveliness", "ingress", ["liveliness_token"], [alive, f"{samples}/@adv/**"]),
        _rule(f"{tag}: answers from its cache", "ingress", ["declare_queryable", "reply"], own),
        _rule(
            f"{tag}: receives queries to its cache", "egress", _RECOVERY, [all_samples, f"{all_samples}/@adv/**", *own]
        ),
        _rule(f"{tag}: requests its pose and settings", "ingress", ["query", "declare_subscriber"], to_tag),
        _rule(f"{tag}: receives its pose and settings", "egress", ["put", "reply"], to_tag),
    ]


def _service(site: str) -> list[Section]:
    samples = keys.all_tags(site, "samples")
    return [_rule("the service", "both", _EVERYTHING, [keys.everything(site), f"{samples}/@adv/**"])]


def _reader(site: str) -> list[Section]:
    poses = [keys.all_tags(site, leaf) for leaf in ("pose", "event")] + [keys.poses_key(site), keys.all_anchors(site)]
    alive = [keys.all_tags(site, "alive"), keys.all_services_alive(site)]
    liveliness = ["liveliness_query", "declare_liveliness_subscriber"]
    return [
        _rule("readers request poses", "ingress", ["query", "declare_subscriber"], poses),
        _rule("readers receive poses", "egress", ["put", "reply", "declare_queryable"], poses),
        _rule("readers request liveliness", "ingress", liveliness, alive),
        _rule("readers receive liveliness", "egress", ["liveliness_token", "reply"], alive),
    ]


def _rule(name: str, flow: str, messages: list[str], key_exprs: list[str]) -> Section:
    flows = ["ingress", "egress"] if flow == "both" else [flow]
    return {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": key_exprs}
