"""Jobs on the cores of this machine or of a Dask cluster, in no particular order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from typing import Any, Final

import joblib

from bridge.errors import MissingExtraError, SurefootError

CONNECT_S: Final = 10.0  # a scheduler that has not answered by then is not there


def work(
    perform: Callable[[Any], dict[str, Any]], jobs: Sequence[Any], processes: int, cluster: str = ""
) -> Iterator[dict[str, Any]]:
    """Yield the result of each job as it is done.

    Args:
        perform: does one job; it and the jobs must travel to other processes.
        jobs: what is to be done.
        processes: how many at a time on this machine.
        cluster: address of a Dask scheduler, such as tcp://10.0.0.1:8786; '' for this machine.

    Raises:
        MissingExtraError: a cluster is named and `distributed` is not installed.
        SurefootError: the scheduler does not answer.
    """
    if not jobs:
        return
    where: Any = nullcontext()
    client: Any = None
    if cluster:
        client = _connect(cluster)
        where = joblib.parallel_config(backend="dask", wait_for_workers_timeout=30)
        processes = -1
    try:
        with where:
            parallel = joblib.Parallel(n_jobs=processes, return_as="generator_unordered", batch_size=1)
            yield from parallel(joblib.delayed(perform)(job) for job in jobs)
    finally:
        if client is not None:
            client.close()


def _connect(address: str) -> Any:
    try:
        from distributed import Client  # noqa: PLC0415 (an extra)
    except ImportError as error:
        raise MissingExtraError("--cluster", "distributed", "cluster") from error
    try:
        client: Any = Client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise SurefootError(f"no Dask scheduler answers at {address}: {error}") from error
    return client
