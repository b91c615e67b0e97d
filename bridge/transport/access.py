"""Who may say what: Zenoh's access control, by the name in the certificate at the other end of a link.

Everything is denied that is not named here. A role may write its own topics and the diagnostics, and hold its
own liveliness token; everybody with a certificate may read; an observer writes nothing; a router hands on what
others, whom it judged by the same rules, gave it. Rules for what comes in do the work, because a process must not
rely on what a stranger's own process lets out.

A trap: a declaration is allowed only if a rule's key expression includes it whole, so a subscriber to `**` gets
nothing under rules for `surefoot/**`; and no `*` matches a part that begins with `@`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from bridge.keys.identity import IDENTITIES, OBSERVER, PUBLISHERS, ROUTER
from bridge.topics import TOPICS
from bridge.transport.names import Names, written_by

_READ: Final = ("declare_subscriber", "declare_liveliness_subscriber", "liveliness_query")
_ALL: Final = (*_READ, "put", "liveliness_token")


def access_control(names: Names) -> dict[str, Any]:
    """Return the value of Zenoh's `access_control` for a process or router of one robot."""
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []

    def allow(identity: str, messages: Sequence[str], keys: Sequence[str], flow: str = "ingress") -> None:
        if not keys:
            return
        rule = f"{identity} {flow} {messages[0]}"
        rules.append(
            {"id": rule, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": list(keys)}
        )
        policies.append({"rules": [rule], "subjects": [identity]})

    for role in PUBLISHERS:
        allow(role, ["put"], [names.key(topic) for topic in written_by(role)])
        allow(role, ["liveliness_token"], [names.alive(role), *names.graph(role)])
        allow(role, _READ, names.space)
    allow(OBSERVER, ["liveliness_token"], names.graph("*"))
    allow(OBSERVER, _READ, names.space)
    allow(ROUTER, ["put"], [names.key(topic) for topic in TOPICS])
    allow(ROUTER, ["liveliness_token"], [names.alive("*"), *names.graph("*")])
    allow(ROUTER, _READ, names.space)
    for identity in IDENTITIES:
        allow(identity, _ALL, names.space, flow="egress")
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": identity, "cert_common_names": [identity]} for identity in IDENTITIES],
        "policies": policies,
    }
