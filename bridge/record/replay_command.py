"""`surefoot replay`: options, checks, and what is said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, TimeElapsedColumn

from bridge.clock import SystemClock
from bridge.command_line import completion
from bridge.command_line.options import (
    ConfigOption,
    ForceOption,
    JsonOption,
    RecordingArgument,
    RecordingOut,
    SetOption,
    TopicsOption,
)
from bridge.command_line.output import note, progress, require_writable, write_json
from bridge.config.load import load_config
from bridge.config.surefoot import SurefootConfig
from bridge.errors import ConfigError, SourceError
from bridge.launch.watch import StopSignals
from bridge.record.feed import Processes, feed
from bridge.record.meter import Meter
from bridge.record.offline import replay_offline
from bridge.record.online import Pace, Played, StandIns, play
from bridge.record.reader import Recording
from bridge.record.roles import INPUTS, outputs, parse_roles, parse_topics
from bridge.record.writer import BagWriter, RecordingError
from bridge.topics import TOPICS, Topic

Told = dict[str, Any]  # what --json says of a replay


def replay(
    recording: RecordingArgument,
    only: Annotated[
        str | None,
        typer.Option(
            metavar="ROLE,...", autocompletion=completion.roles, help="Run these roles and feed them what they read."
        ),
    ] = None,
    rate: Annotated[float, typer.Option(min=0.01, max=100, metavar="X", help="Speed; 1 is real time.")] = 1.0,
    as_fast_as_possible: Annotated[
        bool, typer.Option("--as-fast-as-possible", help="With --only: in simulated time, the same result every time.")
    ] = False,
    out: RecordingOut = None,
    force: ForceOption = False,
    topics: TopicsOption = None,
    delay: Annotated[float, typer.Option(min=0, metavar="S", help="Let readers connect for so long [s].")] = 1.0,
    option: Annotated[
        list[str] | None,
        typer.Option(metavar="[ROLE.]NAME=VALUE", help="Option of a role, such as controller=log; repeatable."),
    ] = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    json: JsonOption = None,
) -> int:
    """Replay a recording: the whole of it on the wire of this machine, or to one process with --only.

    Without --only the recorded messages are published with their stamps moved to now, in the place
    of the processes that published them; none of these may be running. With --only ROLE that process
    is started and fed what it reads; what it publishes goes to --out.

    Example: surefoot replay walk.mcap --only controller --as-fast-as-possible --out again.mcap
    """
    found = Recording(recording)
    loaded = load_config(config, set_ or [])
    if json is not None:
        require_writable(json)
    if only is None:
        _refuse("--out", out is not None, "goes with --only: without a process there is nothing to write")
        _refuse("--as-fast-as-possible", as_fast_as_possible, "goes with --only: live processes know real time alone")
        _refuse("--option", bool(option), "goes with --only")
        told = _replay_all(found, loaded, topics, Pace(rate, delay))
        if json is not None:
            write_json(json, told)
        return 0
    _refuse("--topics", topics is not None, "goes without --only: a role is fed all it reads")
    _refuse("--rate", as_fast_as_possible and rate != 1.0, "does not go with --as-fast-as-possible")
    roles = parse_roles(only)
    processes = Processes(roles, loaded, config, set_ or [], _role_options(option or [], roles))
    writer = _writer(found, out, processes, overwrite=force)
    try:
        if as_fast_as_possible:
            told = _run_offline(found, processes, writer)
        else:
            told = _run_processes(found, processes, Pace(rate, delay), writer)
    except BaseException:
        if writer is not None:
            writer.discard()
        raise
    if json is not None:
        write_json(json, told)
    return 0


def _replay_all(recording: Recording, config: SurefootConfig, topics: str | None, pace: Pace) -> Told:
    listened = [topic for topic in TOPICS if topic.key in recording.listened]
    wanted: Sequence[Topic] = parse_topics(topics) if topics is not None else listened or TOPICS
    roles = {topic.publisher for topic in wanted} - {"*"}
    clock = SystemClock()
    with StandIns(config.bridge, roles or INPUTS, clock) as stand_ins, _Watch(recording) as watch:
        played = play(recording, wanted, stand_ins, pace, clock, watch)
    return _say_played(recording, played)


def _run_offline(recording: Recording, processes: Processes, writer: BagWriter | None) -> Told:
    with progress("{task.description}", BarColumn(), TimeElapsedColumn()) as bar:
        task = bar.add_task(" and ".join(processes.roles), total=1.0)
        result = replay_offline(
            recording,
            processes.roles,
            processes.config,
            processes.options,
            _drop if writer is None else writer.write,
            lambda done: bar.update(task, completed=done),
        )
    if writer is not None:
        writer.finish()
    note(f"{recording.path}: {result.simulated_s:.1f} s; {_counts('fed', result.fed)}")
    note(_answered(result.answered, writer))
    _say_damage(recording)
    return {"recording": recording.path, "damage": recording.damage, **result._asdict()}


def _run_processes(recording: Recording, processes: Processes, pace: Pace, writer: BagWriter | None) -> Told:
    with _Watch(recording) as watch:
        played = feed(recording, processes, pace, writer, watch)
    told = _say_played(recording, played)
    if writer is not None:
        note(f"{writer.out}: {writer.messages} messages")
        told["answered"] = writer.messages
    return told


class _Watch:
    """Says how far a replay is, and ends it when a signal comes."""

    def __init__(self, recording: Recording) -> None:
        self._name, self._meter, self._signals = recording.path, Meter(), StopSignals()

    def __enter__(self) -> _Watch:
        self._signals.__enter__()
        note(f"replaying {self._name}; Ctrl-C ends it")
        return self

    def __exit__(self, *error: object) -> None:
        self._meter.end()
        self._signals.__exit__(*error)

    def __call__(self, progress: float) -> bool:
        if self._meter.due():
            self._meter.show(f"{progress:4.0%}")
        return self._signals.seen is not None


def _writer(recording: Recording, out: Path | None, processes: Processes, *, overwrite: bool) -> BagWriter | None:
    if out is None:
        return None
    if out.resolve() in {recording.path.resolve(), *(file.resolve() for file in recording.files)}:
        raise RecordingError(f"--out {out}: is the recording that is replayed")
    return BagWriter(out, processes.config.bridge.namespace, outputs(processes.roles), overwrite=overwrite)


def _role_options(pairs: Sequence[str], roles: Sequence[str]) -> dict[str, dict[str, str]]:
    options: dict[str, dict[str, str]] = {role: {} for role in roles}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        role, dot, rest = name.partition(".")
        if not dot and len(roles) == 1:
            role, rest = roles[0], name
        if not equals or not rest or role not in options:
            raise ConfigError(f"--option {pair}: expected ROLE.NAME=VALUE, ROLE one of {', '.join(roles)}")
        options[role][rest] = value
    return options


def _refuse(name: str, given: bool, why: str) -> None:
    if given:
        raise ConfigError(f"{name} {why}")


def _drop(_topic: Topic, _sample: object) -> None:
    """Keep nothing."""


def _say_played(recording: Recording, played: Played) -> Told:
    if not played.sent:
        raise SourceError(f"{recording.path}: nothing to replay")
    note(f"{_counts('sent', played.sent)}; at most {played.latest_s * 1e3:.0f} ms late")
    _say_damage(recording)
    return {"recording": recording.path, "damage": recording.damage, **played._asdict()}


def _say_damage(recording: Recording) -> None:
    if recording.damage:
        note(f"{recording.path} is not whole: {recording.damage}")


def _answered(counts: Mapping[str, int], writer: BagWriter | None) -> str:
    return _counts("answered", counts) + (f", in {writer.out}" if writer is not None else "")


def _counts(verb: str, counts: Mapping[str, int]) -> str:
    return f"{verb} " + (", ".join(f"{count} {key}" for key, count in counts.items()) or "nothing")
