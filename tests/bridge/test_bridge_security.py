"""Attacks on a working controller from outside, by real sessions: refused or harmless, and said in its log."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import closing
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from bridge_recordings import command, horizon
from bridge_site import Site, key_of, make_keys, session, tls_of
from bridge_toys import Stage, Up, all_alive, wait_until

from bridge.clock import SystemClock
from bridge.codec import decode, encode
from bridge.keys import authority as making
from bridge.keys.authority import create_authority, issue
from bridge.keys.files import write, write_pair
from bridge.messages import FallHorizon, Wrench
from bridge.topics import DIAGNOSTICS, FALL_HORIZON, SUPPORT_COMMAND, WRENCH
from bridge.transport.attachment import pack, unpack
from bridge.transport.zenoh import ZenohTransport

pytestmark = [pytest.mark.processes, pytest.mark.timeout(300)]  # several waits, each patient with a busy machine

CLOCK = SystemClock()


@pytest.fixture(scope="module")
def shared_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with closing(Site(tmp_path_factory.mktemp("site"))) as made:
        yield made


@pytest.fixture
def site(shared_site: Site) -> Iterator[Site]:
    """The controller at work; after every attack it works on, and never did what the attacker wanted."""
    shared_site.recovers()
    yield shared_site
    shared_site.recovers()
    states = {status.values["state"] for status in shared_site.statuses.seen}
    assert states <= {"DISARMED", "FOLLOW", "GUARD", "RECOVER", "SAFE_STOP"}, "no forged fall was believed"
    commands = list(shared_site.feed.commands)
    assert len({sample.source for sample in commands}) == 1, "the drive heard one controller"


def falling() -> FallHorizon:
    """A forged horizon: whoever believes it arrests a walker whom nobody fell into."""
    return horizon(CLOCK.now_ns(), fall=0.49)


def put(attacker: Any, topic: Any, message: Any, number: int = 1, source: bytes = b"x" * 16) -> None:
    attacker.put(key_of(topic), encode(topic, message), attachment=pack(number, message.stamp_ns, source))


def refused_at_the_door(site: Site, tls: dict[str, object] | None, endpoint: str, reason: str) -> None:
    with closing(session(endpoint, tls)) as attacker:
        site.knows(f"refused: a connection: {reason}")
        put(attacker, FALL_HORIZON, falling())
        assert attacker.info.links() == []


def test_without_a_certificate(site: Site) -> None:
    only_trusts = {"root_ca_certificate": str(site.keys / "ca.pem")}
    refused_at_the_door(site, only_trusts, site.endpoint("controller"), "peer sent no certificates")


def test_with_a_certificate_of_a_foreign_authority(site: Site) -> None:
    foreign = create_authority(30)
    write_pair(site.keys, "foreign", issue(foreign, "anticipation", [], 30))
    tls = tls_of(site.keys, "foreign")
    refused_at_the_door(site, tls, site.endpoint("controller"), "invalid peer certificate: UnknownIssuer")


def test_with_an_expired_certificate(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "SLOW_CLOCK", timedelta(days=3))
    write_pair(site.keys, "expired", issue(site.authority, "anticipation", [], -1))
    tls = tls_of(site.keys, "expired")
    refused_at_the_door(site, tls, site.endpoint("controller"), "invalid peer certificate: certificate expired")


def test_a_certificate_that_ends_while_it_is_used(site: Site) -> None:
    lasts_days = 2.5 / 86400.0
    write_pair(site.keys, "brief", issue(site.authority, "observer", [], lasts_days))  # type: ignore[arg-type]
    with closing(session(site.endpoint("controller"), tls_of(site.keys, "brief"))) as attacker:
        wait_until(attacker.info.links, "the certificate is good")
        wait_until(lambda: not attacker.info.links(), "the link is closed when it ends")
        site.knows("refused: a connection: invalid peer certificate: certificate expired")


def test_without_encryption(site: Site) -> None:
    plain = site.endpoint("controller").replace("tls/", "tcp/")
    refused_at_the_door(site, None, plain, "received corrupt message")


def test_a_server_of_a_foreign_authority_is_not_talked_to(site: Site) -> None:
    """Somebody took perception's place before it came: the controller, which connects there, does not believe him."""
    foreign = create_authority(30)
    write(site.keys / "imposter-ca.pem", foreign.certificate_pem(), 0o644)
    write_pair(site.keys, "imposter", issue(foreign, "perception", [], 30))
    config = zenoh.Config()
    files = tls_of(site.keys, "imposter", "imposter-ca")
    listens = {"listen_private_key": files["connect_private_key"], "listen_certificate": files["connect_certificate"]}
    for path, value in {
        "listen/endpoints": [site.endpoint("perception")],
        "scouting/multicast/enabled": False,
        "transport/link/tls": files | listens,
    }.items():
        config.insert_json5(path, json.dumps(value))
    with closing(zenoh.open(config)) as imposter:
        site.knows(f"refused: to connect to {site.endpoint('perception')}: invalid peer certificate: UnknownIssuer")
        put(imposter, FALL_HORIZON, falling())
        assert imposter.info.links() == []


@pytest.mark.parametrize("who", ["perception", "observer", "drive"])
def test_who_may_not_say_it(site: Site, who: str) -> None:
    """A certificate of ours, and a topic of somebody else's."""
    with closing(session(site.endpoint("controller"), tls_of(site.keys, who))) as attacker:
        wait_until(attacker.info.links, "the certificate is good")

        def attack() -> bool:
            put(attacker, FALL_HORIZON, falling(), number=1 << 40)
            return f"refused: {who} may not put {key_of(FALL_HORIZON)}" in site.controller.said

        wait_until(attack, "the log says who did what")
        token = attacker.liveliness().declare_token("surefoot/alive/controller")
        site.knows(f"refused: {who} may not claim surefoot/alive/controller")
        token.undeclare()


def test_perception_may_not_command_the_drive(site: Site) -> None:
    before = len(site.feed.commands)
    with closing(session(site.endpoint("drive"), tls_of(site.keys, "perception"))) as attacker:
        wait_until(attacker.info.links, "the certificate is good")
        for number in range(100):
            put(attacker, SUPPORT_COMMAND, command(CLOCK.now_ns()), number=number, source=b"evil" * 4)
            wait_until(lambda number=number: len(site.feed.commands) > before + number // 10, "the controller goes on")
        assert b"evil" * 4 not in {sample.source for sample in site.feed.commands}


def test_a_stranger_whom_the_authority_knows_may_nothing(site: Site) -> None:
    write_pair(site.keys, "stranger", issue(site.authority, "stranger", [], 30))
    with closing(session(site.endpoint("controller"), tls_of(site.keys, "stranger"))) as attacker:
        heard: list[Any] = []
        subscriber = attacker.declare_subscriber(key_of(SUPPORT_COMMAND), heard.append)
        site.knows("refused: stranger at tls/127.0.0.1:")
        seen = len(site.feed.commands)
        while len(site.feed.commands) < seen + 20:  # the controller speaks, to others
            put(attacker, WRENCH, _wrench())
        subscriber.undeclare()
        assert heard == []


def _wrench() -> Any:
    return Wrench(stamp_ns=CLOCK.now_ns(), force=np.array([900.0, 0.0, -900.0]), torque=np.zeros(3))


class Recorded:
    """What was on the wire of a topic while listened to, as an observer hears it."""

    def __init__(self, site: Site) -> None:
        self.samples: list[Any] = []
        self._session = session(site.endpoint("controller"), tls_of(site.keys, "observer"))
        self._other = session(site.config.endpoints["anticipation"], tls_of(site.keys, "observer"))
        self._subscriber = self._other.declare_subscriber(key_of(FALL_HORIZON), self.samples.append)

    def close(self) -> None:
        self._subscriber.undeclare()
        self._other.close()
        self._session.close()


def test_an_old_message_again(site: Site) -> None:
    """Recorded on the wire and sent again as it was, with the very certificate of its publisher."""
    with closing(Recorded(site)) as recorded:
        wait_until(lambda: len(recorded.samples) > 3, "some horizons were recorded")
    old = recorded.samples[0]
    number, _source = unpack(old.attachment.to_bytes())
    with closing(session(site.endpoint("controller"), tls_of(site.keys, "anticipation"))) as attacker:

        def attack() -> bool:
            attacker.put(key_of(FALL_HORIZON), old.payload.to_bytes(), attachment=old.attachment.to_bytes())
            return f"refused: fall_horizon: number {number} after" in site.controller.said

        wait_until(attack, "the log says that it is old")


def test_an_oversized_message(site: Site) -> None:
    """From the publisher that is followed, or so it says; the limits of the wire itself stop what is longer still."""
    with closing(Recorded(site)) as recorded:
        wait_until(lambda: recorded.samples, "a horizon was recorded")
    _number, source = unpack(recorded.samples[-1].attachment.to_bytes())
    with closing(session(site.endpoint("controller"), tls_of(site.keys, "anticipation"))) as attacker:

        def attack() -> bool:
            number = site.feed.sent(FALL_HORIZON) + 2
            for size in (100_000, 5_000_000):
                attacker.put(key_of(FALL_HORIZON), bytes(size), attachment=pack(number, CLOCK.now_ns(), source))
            return "refused: fall_horizon: fall_horizon is 100000 bytes, limit 65536" in site.controller.said

        wait_until(attack, "the log says that it is too long")


FLOOD = textwrap.dedent("""
    import json, sys, time
    sys.path.insert(0, sys.argv[4])
    from pathlib import Path
    from bridge_site import session, tls_of
    attacker = session(sys.argv[1], tls_of(Path(sys.argv[2]), sys.argv[3]))
    publisher = attacker.declare_publisher("surefoot/fall_horizon")
    payload = bytes(4000)
    print("begun", flush=True)
    while True:
        for _ in range(200):
            publisher.put(payload)
        time.sleep(0.01)
""")


@pytest.mark.parametrize(
    ("who", "said"),
    [("perception", "perception may not put surefoot/fall_horizon ("), ("anticipation", "fall_horizon: a flood, ")],
)
def test_a_flood_on_a_topic(site: Site, who: str, said: str) -> None:
    """Thousands a second, from who may not say it and from who may; true horizons come through, commands go on."""
    words = [site.endpoint("controller"), str(site.keys), who, str(Path(__file__).parent)]
    with subprocess.Popen([sys.executable, "-c", FLOOD, *words], stdout=subprocess.PIPE) as attacker:
        try:
            site.knows(said)
            site.statuses.seen.clear()
            before = len(site.feed.commands)
            wait_until(lambda: site.statuses.newest() and len(site.statuses.seen) > 15, "statuses during the flood")
            wait_until(lambda: len(site.feed.commands) > before + 200, "two hundred commands during the flood")
            during = site.feed.commands[before:]
            assert [sample.sequence for sample in during] == sorted({sample.sequence for sample in during})
            frames = [decode(SUPPORT_COMMAND, sample.payload).rests_on_ns for sample in during]
            seen = [frame for frame in frames if frame]  # while a stop lasts a command rests on no frame
            assert seen == sorted(seen)
            assert len(set(seen)) > 15, "the true horizons come through, one after the other"
            states = {status.values["state"] for status in site.statuses.seen}
            assert "FOLLOW" in states
            assert states <= {"FOLLOW", "RECOVER", "SAFE_STOP"}
        finally:
            attacker.kill()


def test_surefoot_up_runs_on_certificates(tmp_path: Path) -> None:
    """Launcher, monitor and processes, each with its own certificate."""
    stage = Stage(tmp_path)
    make_keys(tmp_path / "keys")
    pairs = [f"bridge.endpoints.{role}=tls/127.0.0.1:{port}" for role, port in stage.ports.items()]
    words = [word for pair in (f"bridge.keys={tmp_path / 'keys'}", *pairs) for word in ("--set", pair)]
    with Up(stage, "--roles", "perception,controller", *words) as up:
        up.wait_for(all_alive(("perception", "controller")))
        up.wait_for(lambda record: record.get("command") and record["command"]["state"] == "FOLLOW")
        code, errors = up.stop()
    assert (code, errors) == (0, "")


def test_an_observer_may_look(site: Site) -> None:
    config, heard = site.config, []
    with closing(ZenohTransport(config, "recorder", CLOCK)) as recorder:
        for topic in (SUPPORT_COMMAND, DIAGNOSTICS, FALL_HORIZON, WRENCH):
            recorder.subscribe(topic, lambda _sample, topic=topic: heard.append(topic.key))
        wait_until(lambda: len(set(heard)) == 4, "it hears everything")
