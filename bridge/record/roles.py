"""Which role reads what: the streams a replay has to feed to a process that runs alone."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from bridge.errors import ConfigError
from bridge.topics import FALL_HORIZON, KEYPOINTS, ODOMETRY, SUPPORT_COMMAND, TOPICS, WRENCH, Topic

INPUTS: Final[dict[str, tuple[Topic, ...]]] = {  # in the order in which a message passes through the roles
    "perception": (),
    "anticipation": (KEYPOINTS,),
    "controller": (FALL_HORIZON, WRENCH, ODOMETRY),
    "drive": (SUPPORT_COMMAND,),
}


def parse_roles(text: str) -> tuple[str, ...]:
    """Return the roles named in `text`, such as `anticipation,controller`, in the order of their messages.

    Raises:
        ConfigError: an unknown role, or one that reads nothing that is recorded.
    """
    named = {role.strip() for role in text.split(",")}
    for role in sorted(named):
        if role not in INPUTS:
            raise ConfigError(f"--only {role}: no such role; known: {', '.join(INPUTS)}")
        if not INPUTS[role]:
            raise ConfigError(f"--only {role}: it reads no recorded topic")
    return tuple(role for role in INPUTS if role in named)


def parse_topics(text: str) -> tuple[Topic, ...]:
    """Return the topics named by their keys in `text`, such as `keypoints,odom`, in the order of the topic table.

    Raises:
        ConfigError: an unknown key.
    """
    known = {topic.key: topic for topic in TOPICS}
    named = {key.strip() for key in text.split(",")}
    for key in sorted(named):
        if key not in known:
            raise ConfigError(f"--topics {key}: no such topic; known: {', '.join(known)}")
    return tuple(topic for topic in TOPICS if topic.key in named)


def outputs(roles: Iterable[str]) -> tuple[Topic, ...]:
    """Return what `roles` publish, without the diagnostics that all of them write."""
    wanted = set(roles)
    return tuple(topic for topic in TOPICS if topic.publisher in wanted)


def inputs(roles: Iterable[str]) -> tuple[Topic, ...]:
    """Return what `roles` read and none of them publishes."""
    wanted = tuple(roles)
    made = outputs(wanted)
    read = {topic.key for role in wanted for topic in INPUTS[role]}
    return tuple(topic for topic in TOPICS if topic.key in read and topic not in made)
