"""How each documented command is executed. What is not named here is executed as it stands, on stand-in files.

The first pattern that fits a command whole counts. A command that cannot be run here is named with the reason; there is
no other way to leave one out. What is not executed in the default suite is parsed there: options and values must exist.
"""

from __future__ import annotations

import re
from typing import NamedTuple


class Way(NamedTuple):
    """How a command is executed."""

    why: str  # it is not simply run
    extra: str = ""  # options after its own, which win: cheaper, or away from what else runs on this machine
    long: bool = False  # executed by `make test-docs` alone
    beside: bool = False  # executed while a whole system runs
    data: bool = False  # needs the research data
    never: bool = False  # executed nowhere
    codes: tuple[int, ...] = (0,)  # exit codes that are as they should be
    stops_s: float = 0.0  # it runs until Ctrl-C, which it is sent after so long; 0: it ends by itself
    says: str = ""  # what its output has to hold, where the exit code alone does not tell


SHORT = "--no-screen --duration 15 {wire}"
AT_WORK = "DISARMED|FOLLOW|GUARD|ARREST|SAFE_STOP"  # commands came
QUICK = "--quick --folds 2 --no-baselines"

WAYS: dict[str, Way] = {
    # the whole system
    r"surefoot up( --config FILE)?": Way("asks for a source", never=True),
    r"surefoot up .*(--source camera:|rtsp:).*": Way("needs a camera", never=True),
    r"surefoot up .*examples/alarm.*": Way("real processes, and no controller", SHORT, long=True, says="alarm running"),
    r"surefoot up .*--estimator movenet.*": Way(
        "real processes, with weights that come with the research data",
        SHORT + " --set perception.movenet.weights={data}/weights/movenet_lightning_int8.tflite",
        long=True,
        data=True,
        says=AT_WORK,
    ),
    r"surefoot (up|router) --config (camera|walker)\.toml.*": Way(
        "two machines; tests/bridge/test_bridge_several_machines.py runs both files", never=True
    ),
    r"surefoot up --config keys/bridge\.toml.*": Way(
        "real processes over TLS", "--no-screen --duration 15 {tls}", long=True, says=AT_WORK
    ),
    r"surefoot router .*": Way(
        "runs until it is stopped", "--set 'bridge.router.listen=[\"tls/127.0.0.1:{port}\"]'", long=True, stops_s=8
    ),
    r"surefoot up .*": Way("real processes", SHORT, long=True, says=AT_WORK),
    r"surefoot (demo|rehearse).*": Way("real processes in real time", long=True),
    r"surefoot latency.*": Way("real processes, for some seconds", "--duration 3", long=True),
    r"surefoot \S+ .*--json FILE": Way("FILE stands for any file", "--json said.json"),
    r"surefoot --install-completion": Way("changes what the shell reads at its start", never=True),
    r"surefoot record.*": Way("beside a system", "--duration 1 --force {beside}", beside=True),
    r"surefoot view": Way(
        "beside a system; a file instead of a window", "--out live.rrd --force --duration 1 {beside}", beside=True
    ),
    r"surefoot view --serve": Way("beside a system; a page without a browser", "--duration 1 {beside}", beside=True),
    r"surefoot view \S+\.mcap( --video .*)?": Way("a file instead of a window", "--out shown.rrd --force"),
    r"surefoot replay \S+": Way("in real time, on ports of its own", "--delay 0 {wire}"),
    r"python examples/.*": Way("runs until it is stopped", "{wire}", long=True, stops_s=15),
    r"surefoot tune .*--serve.*": Way(
        "serves a page until it is stopped", "--port 0", long=True, stops_s=30, says="open http://127.0.0.1:"
    ),
    r"surefoot tune runs/campaign .*": Way("replays a campaign that was performed before it", long=True),
    r"surefoot tune .*--method study.*": Way("a smaller study", "--trials 4"),
    r"surefoot personalise( --.*)?": Way(
        "asks at the terminal; tests/controller/test_controller_personal_command.py answers", never=True
    ),
    r"surefoot doctor( --config .*)?": Way("looks at this machine, for some seconds", "{wire}", long=True),
    # what learns
    r"surefoot train.*cuda.*": Way("needs a GPU", never=True),
    r"torchrun .*--nnodes.*": Way("needs two machines", never=True),
    r"torchrun .*": Way("two processes; learns", "--quick --force", long=True, data=True),
    r"surefoot train.*": Way("learns", "--quick --force --no-tensorboard", long=True, data=True),
    r"surefoot evaluate --from .*": Way("of a report that a quick run made", "--quick", long=True, data=True),
    r"surefoot evaluate.*": Way("learns", f"{QUICK} --no-live", long=True, data=True),
    r"surefoot data.*": Way("counts the research data", long=True, data=True),
    # what performs
    r"surefoot clips.*": Way("performs in simulated time", "--falls 1 --non-falls 1 --jobs 1", long=True),
    r"surefoot campaign.*": Way("performs in simulated time", "--scenarios 1 --non-falls 1 --jobs 1", long=True),
    r"surefoot codegen .*": Way("CasADi writes C for some seconds", long=True),
    r"surefoot export .*": Way("traces and compares for some seconds", long=True),
    # benchmarks
    r"python -m benchmarks\.mpc.*": Way("measures", "--seconds 0.5", long=True),
    r"python -m benchmarks\.anticipation.*": Way("measures", "--times 20", long=True),
    r"python -m benchmarks\.wire.*": Way("measures", "--rate 100 --seconds 1 --no-tls", long=True),
    r"python -m benchmarks\.(loop|simulation).*": Way("measures", "--seconds 2", long=True),
    r"python -m benchmarks\.personal.*": Way("asks simulated people", "--people 1", long=True),
    r"python -m benchmarks\.walks.*": Way("measures", "--seconds 2", long=True),
    r"python -m benchmarks\.falls.*": Way("measures", "--falls 2", long=True),
    r"python -m benchmarks\.foresight.*": Way("performs falls", "--falls 1", long=True),
    r"python -m benchmarks\.faults.*": Way("measures real processes", "--list", long=True),
    r"python -m benchmarks\.fuzz.*": Way("a million payloads", "--count 50 --json runs/fuzz.json", long=True),
    r"python -m benchmarks\.soak.*": Way(
        "half an hour; 1 says that this machine was too slow", "--minutes 0.05 --times 1", long=True, codes=(0, 1)
    ),
    r"python -m benchmarks\.anticipated_fall.*": Way("runs the recording with the MPC", long=True),
    # make, whose recipes are judged line by line
    r"(SUREFOOT_EXAMPLES=\S+ )?python -m pytest.*": Way("this is it", never=True),
    r"python tests/controller/mutate_gate\.py": Way("ten minutes of other tests", never=True),
    r"python -m mkdocs .*|NO_MKDOCS_2_WARNING=1 python -m mkdocs .*": Way(
        "tests/documentation/test_documentation_site.py", never=True
    ),
    r"python docs/generate/outside\.py .*": Way("tests/documentation/test_documentation_site.py", never=True),
    r"python docs/pictures.*": Way("draws six pictures", "--out runs/pictures", long=True),
    r"(ruff|mypy).*": Way("`make lint` itself", never=True),
    r"make .*": Way("each line of its recipe is judged by this table"),
    # elsewhere
    r"pip (install|freeze).*": Way("changes the environment; extras and files are looked up", never=True),
    r"rerun .*|zenohd .*|ros2 .*|mcap .*|tensorboard .*|dask .*": Way("a program that is not ours", never=True),
    r"(export|\.|source|cd|mkdir|eval) .*": Way("the shell's own", never=True),
    r"surefoot COMMAND --help": Way("stands for every command", never=True),
    r"surefoot keys zenoh ROLE": Way("stands for every role", never=True),
}


def way(text: str) -> Way:
    """Return how a command is executed."""
    return next((way for pattern, way in WAYS.items() if re.fullmatch(pattern, text)), Way(""))
