"""Runs many tasks on an engine: threads that each run one command, any executor of concurrent.futures, or a cluster of dask.distributed."""

import os
import queue
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

from . import _task
from ._store import Campaign
from ._table import Row

AHEAD = 4096
"""Number of rows that may wait for an earlier one, because rows are yielded in the order of the campaigns."""


@dataclass(frozen=True)
class Progress:
    """Progress of a run."""

    done: int = 0
    """Campaigns that are finished."""
    failed: int = 0
    """Finished campaigns without an answer."""
    cached: int = 0
    """Finished campaigns whose answer came from the cache."""

    def __add__(self, row: Row) -> "Progress":
        return replace(self, done=self.done + 1, failed=self.failed + (row["error"] is not None), cached=self.cached + bool(row["cached"]))


def slots(executor: Any) -> int:
    """Number of tasks that the engine runs at a time."""
    if hasattr(executor, "nthreads"):
        return max(1, int(sum(executor.nthreads().values())))
    return int(getattr(executor, "_max_workers", None) or os.cpu_count() or 1)


def run(
    campaigns: Iterator[Campaign],
    settings: _task.Settings,
    executor: Any = None,
    workers: int | None = None,
    done: Callable[[Progress], None] = lambda _: None,
) -> Iterator[Row]:
    """Rows in the order of the campaigns. Only a few tasks per worker are submitted at a time, whatever the number of campaigns.

    Closing the iterator cancels the run: tasks that have not begun are dropped, and commands run by threads of this process are terminated.
    """
    children = _task.Children()
    # Each campaign is worked on by a process of its own, so threads that wait for these processes suffice.
    own = ThreadPoolExecutor(workers or _cores()) if executor is None else None
    engine: Any = own or executor
    cluster = engine if hasattr(engine, "get_executor") else None
    submitter: Executor = cluster.get_executor(pure=False) if cluster is not None else engine
    arguments = (settings, children) if own else (settings,)
    finished: queue.SimpleQueue[Future[Row]] = queue.SimpleQueue()
    pending: dict[Future[Row], tuple[int, Campaign]] = {}
    rows: dict[int, Row] = {}
    progress, begun, told, more = Progress(), 0, 0, True
    try:
        while more or pending:
            # The number of slots is read again each time, because workers of a cluster may come and go.
            window = 2 * slots(engine) + 2
            while more and len(pending) < window and begun - told < AHEAD:
                campaign = next(campaigns, None)
                if campaign is None:
                    more = False
                    break
                future = submitter.submit(_task.run, campaign, *arguments)
                pending[future] = (begun, campaign)
                future.add_done_callback(finished.put)
                begun += 1
            if not pending:
                break
            future = finished.get()
            place, campaign = pending.pop(future)
            rows[place] = row = _result(future, campaign)
            progress += row
            done(progress)
            while told in rows:
                yield rows.pop(told)
                told += 1
    finally:
        children.stop()
        for future in pending:
            future.cancel()
        if own:
            own.shutdown(wait=True, cancel_futures=True)
        elif cluster is not None:
            submitter.shutdown(wait=False)


def _cores() -> int:
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _result(future: "Future[Row]", campaign: Campaign) -> Row:
    """The row of a task, even if the task was lost with its worker."""
    try:
        return future.result()
    except (Exception, CancelledError) as error:  # noqa: BLE001 whatever the engine says, the other campaigns go on
        said = f"the task was lost: {type(error).__name__}: {error}; run the same again"
        return {"campaign": campaign.url, "name": campaign.name, "cached": False, "error": said, "attempts": 1, "seconds": 0.0}
