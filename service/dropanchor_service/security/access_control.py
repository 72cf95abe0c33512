"""Zenoh's access control for one site: who may send what on which keys. Whatever is not allowed here is denied.

Zenoh knows no template for "its own name", so every tag has rules of its own. `**` does not cover the verbatim chunk
`@adv`, under which publishers that recover lost messages keep their caches, so that it stands beside its key.
"""

from collections.abc import Iterable
from typing import Any

from dropanchor_schemas import keys

SERVICE, READER, ROUTER = "service", "reader", "router"
ROLES = (SERVICE, READER, ROUTER)
"""Common names that no tag can have."""

MAX_SAMPLES_BYTES = 16_384  # 50 samples in JSON are some 8 kB

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
    """The section `access_control` of a router's configuration. tags: their ids, which are their common names."""
    by_name = {SERVICE: _service(site), READER: _reader(site)}
    by_name |= {tag: _tag(site, tag) for tag in tags}
    rules = [rule for of_one in by_name.values() for rule in of_one]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in by_name],
        "policies": [
            {"rules": [rule["id"] for rule in of_one], "subjects": [name]} for name, of_one in by_name.items()
        ],
    }


def low_pass_filter(site: str) -> list[Section]:
    """The section `low_pass_filter`: messages of samples have a size."""
    samples = keys.all_tags(site, "samples")
    return [
        {
            "id": "samples",
            "flows": ["ingress"],
            "messages": ["put", "delete", "query", "reply"],
            "key_exprs": [samples, f"{samples}/@adv/**"],
            "size_limit": MAX_SAMPLES_BYTES,
        }
    ]


def _tag(site: str, tag: str) -> list[Section]:
    samples, alive, pose = keys.samples_key(site, tag), keys.tag_alive_key(site, tag), keys.pose_key(site, tag)
    everyone = keys.all_tags(site, "samples")
    own = [samples, f"{samples}/@adv/**"]
    return [
        _rule(f"{tag}: its samples", "ingress", ["put"], own),
        _rule(f"{tag}: its liveliness", "ingress", ["liveliness_token"], [alive, f"{samples}/@adv/**"]),
        _rule(f"{tag}: its cache answers", "ingress", ["declare_queryable", "reply"], own),
        _rule(f"{tag}: its cache is asked", "egress", _RECOVERY, [everyone, f"{everyone}/@adv/**", *own]),
        _rule(f"{tag}: asks for its pose", "ingress", ["query", "declare_subscriber"], [pose, keys.all_anchors(site)]),
        _rule(f"{tag}: is told its pose", "egress", ["put", "reply"], [pose, keys.all_anchors(site)]),
    ]


def _service(site: str) -> list[Section]:
    samples = keys.all_tags(site, "samples")
    return [_rule("the service", "both", _EVERYTHING, [keys.everything(site), f"{samples}/@adv/**"])]


def _reader(site: str) -> list[Section]:
    shown = [keys.all_tags(site, "pose"), keys.poses_key(site), keys.all_anchors(site)]
    alive = [keys.all_tags(site, "alive"), keys.all_services_alive(site)]
    asks = ["liveliness_query", "declare_liveliness_subscriber"]
    return [
        _rule("readers ask for poses", "ingress", ["query", "declare_subscriber"], shown),
        _rule("readers are told poses", "egress", ["put", "reply", "declare_queryable"], shown),
        _rule("readers ask who is there", "ingress", asks, alive),
        _rule("readers are told who is there", "egress", ["liveliness_token", "reply"], alive),
    ]


def _rule(name: str, flow: str, messages: list[str], key_exprs: list[str]) -> Section:
    flows = ["ingress", "egress"] if flow == "both" else [flow]
    return {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": key_exprs}
