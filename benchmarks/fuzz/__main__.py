"""Mutated payloads against every decoder: nothing but `InvalidMessage` may come out of it, and nothing invalid through.

    python -m benchmarks.fuzz                                   # 1,000,000 payloads for each decoder
    python -m benchmarks.fuzz --topic wrench --count 20000
    python -m benchmarks.fuzz --json runs/fuzz.json --seed 7

An accepted message is judged again by `benchmarks.fuzz.reference`, which shares no code with the decoder. Memory
is the resident set of this process after a tenth of the payloads and after all.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from benchmarks.fuzz.corpus import corpus
from benchmarks.fuzz.run import Finding, fuzz
from bridge.topics import TOPICS


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    decoders = {topic.ros_type: topic for topic in reversed(TOPICS)}  # one for each type
    keys = [topic.key for topic in decoders.values()]
    parser.add_argument("--topic", action="append", choices=keys, help="only this decoder; repeatable")
    parser.add_argument("--count", type=int, default=1_000_000, help="payloads for each decoder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, help="merged by decoder into this file")
    arguments = parser.parse_args()
    failed = False
    for topic in decoders.values():
        if arguments.topic and topic.key not in arguments.topic:
            continue
        found = fuzz(topic, corpus(topic), arguments.count, arguments.seed)
        failed |= found.failed
        print(found.line(), flush=True)
        if arguments.json:
            _merge(arguments.json, found)
    return 1 if failed else 0


def _merge(file: Path, found: Finding) -> None:
    results: dict[str, Any] = json.loads(file.read_text()) if file.is_file() else {}
    results[found.key] = found.as_json()
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    raise SystemExit(main())
