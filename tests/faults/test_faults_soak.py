"""What a soak notices: a lost sample, growth, a stop; and that it runs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.fuzz.corpus import corpus
from benchmarks.soak.measure import Counter, growth_kb, judge
from bridge.topics import DETECTIONS, KEYPOINTS, TOPICS, WRENCH, Topic
from bridge.transport.interface import Sample

REPO = Path(__file__).resolve().parents[2]
START = 1_795_334_344_860_158_123
MS = 1_000_000


def counted(topic: Topic, numbers: list[int], delay_ms: float = 1.0, later_ms: float = 1.0) -> dict:
    """Return what a counter makes of samples with these numbers; the delay changes half-way."""
    count = 1_200
    counter = Counter(topic, START, START + count * MS)
    payload = corpus(topic)[0]  # stamped START
    from benchmarks.faults.stream_faults import Carried

    for k, number in enumerate(numbers):
        stamp = START + k * MS
        late = delay_ms if k < len(numbers) / 2 else later_ms
        carried = Carried(payload, b"\0" * 33).stamped(stamp)
        counter.note(Sample(carried.payload, number, b"p" * 16, stamp + round(late * MS)))
    return counter.result()


def test_whole_counts_are_equal_and_no_problem() -> None:
    result = counted(KEYPOINTS, list(range(1_100)))
    assert (result["sent"], result["heard"], result["lost"], result["disordered"]) == (1_100, 1_100, 0, 0)
    assert result["age_p50_ms"][0] == pytest.approx(1.0)
    assert judge({"keypoints": result}, {}, []) == []


def test_a_lost_sample_counts_where_every_one_is_promised() -> None:
    numbers = [k for k in range(1_100) if k != 500]
    assert judge({"keypoints": counted(KEYPOINTS, numbers)}, {}, []) == ["keypoints: 1 of 1100 lost, and none may be"]
    wrench = counted(WRENCH, numbers)
    assert wrench["lost"] == 1
    assert judge({"wrench": wrench}, {}, []) == []


def test_disorder_and_growing_age_are_said() -> None:
    assert "out of order" in judge({"wrench": counted(WRENCH, [0, 1, 3, 2, *range(4, 1_000)])}, {}, [])[0]
    assert "grew from 1.00 to 9.00 ms" in judge({"wrench": counted(WRENCH, list(range(1_100)), 1.0, 9.0)}, {}, [])[0]


def test_memory_that_grows_is_told_from_memory_that_wobbles() -> None:
    flat = [50_000.0 + 300.0 * (k % 3) for k in range(90)]
    settling = [40_000.0 + 10_000.0 * min(k / 20, 1.0) for k in range(90)]
    growing = [50_000.0 + 100.0 * k for k in range(90)]
    assert abs(growth_kb(flat)) < 200
    assert abs(growth_kb(settling)) < 200
    assert growth_kb(growing) == pytest.approx(5_900)
    assert judge({}, {"drive": growing}, []) == ["drive: memory grew by 5900 kB, limit 2048"]


def test_a_stop_is_a_lost_watchdog() -> None:
    assert judge({}, {}, ["controller: wrench is 80 ms old"]) == ["watchdog: controller: wrench is 80 ms old"]


@pytest.mark.processes
@pytest.mark.timeout(300)
def test_it_runs(tmp_path: Path) -> None:
    file = tmp_path / "soak.json"
    command = [sys.executable, "-m", "benchmarks.soak", "--minutes", "0.05", "--times", "2", "--json", str(file)]
    ended = subprocess.run(command, cwd=REPO, capture_output=True, text=True, timeout=240, check=False)
    assert ended.returncode in (0, 1), ended.stderr  # 1: on a busy machine something may be late
    result = json.loads(file.read_text())
    assert result["topics"].keys() == {topic.key for topic in TOPICS}
    silent = {key for key, topic in result["topics"].items() if topic["heard"] < 10}
    assert silent == {DETECTIONS.key}, "the drive without a robot has no camera"
    assert result["memory_kb"].keys() == {"perception", "anticipation", "controller", "drive"}
