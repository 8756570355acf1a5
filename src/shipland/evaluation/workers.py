"""Flights on several cores: processes that are stopped when asked, and whose finished flights are kept."""

from __future__ import annotations

import itertools
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from shipland.errors import DataError
from shipland.stopping import check_stop

Job = TypeVar("Job")
Done = TypeVar("Done")


@dataclass
class _Worker(Generic[Job]):
    process: BaseProcess
    link: Connection
    job: Job | None = None


def run_jobs(
    do: Callable[[Job], Done],
    jobs: Iterable[Job],
    workers: int,
    keep: Callable[[Job, Done], None],
    lose: Callable[[Job, str], None] | None = None,
) -> Iterator[tuple[Job, Done]]:
    """Yield every job with what came of it, in the order in which they finish.

    With one worker the jobs run here. With more, each has a process of its own; no more jobs are taken from `jobs` than
    there are workers. When the iteration ends early for any reason, what has finished is still kept, and the processes
    are killed. Within `stop_requests` a request ends it.

    Args:
        do: the work; a function of a module, because it is pickled, and so are jobs and results.
        jobs: what to do, one after another.
        workers: processes.
        keep: called here with every finished job, before it is yielded.
        lose: called here with a job that raised or whose process died, and why; a process that died is replaced.
            None: such a job ends the iteration.

    Raises:
        DataError: a worker process died, for instance for want of memory: without `lose` the first, with it when
            `_DEATHS` die one after another.
        Exception: without `lose`, whatever `do` raised.
    """
    if workers == 1:
        for job in jobs:
            check_stop()
            try:
                done = do(job)
            except Exception as error:
                if lose is None:
                    raise
                lose(job, _words(error))
                continue
            keep(job, done)
            yield job, done
        return
    # spawn: an OpenGL context does not survive a fork
    context = multiprocessing.get_context("spawn")
    waiting = iter(jobs)
    hired: list[_Worker[Job]] = []
    deaths = 0
    try:
        hired.extend(_hire(context, do, job) for job in itertools.islice(waiting, workers))
        while busy := [worker for worker in hired if worker.job is not None]:
            ready = multiprocessing.connection.wait([worker.link for worker in busy], POLL_S)
            check_stop()
            for worker in busy:
                if worker.link not in ready or worker.job is None:
                    continue
                job = worker.job
                try:
                    done = _received(worker)
                except _DeadError as error:
                    deaths += 1
                    if lose is None or deaths >= _DEATHS:
                        raise
                    lose(job, str(error))
                    hired.remove(worker)
                    following = next(waiting, None)
                    if following is not None:
                        hired.append(_hire(context, do, following))
                    continue
                except Exception as error:
                    if lose is None:
                        raise
                    lose(job, _words(error))
                    _next_job(worker, waiting)
                    continue
                deaths = 0
                keep(job, done)
                _next_job(worker, waiting)
                yield job, done
    finally:
        for worker in hired:
            if worker.job is not None and worker.link.poll():
                with suppress(Exception):  # one that failed or died is flown again
                    keep(worker.job, _received(worker))
            worker.process.kill()
        for worker in hired:
            worker.process.join()


POLL_S = 0.2
"""How often a loop that waits for results looks for a request to stop."""
_DEATHS = 5
"""Worker processes that die one after another: it is not the flights."""


class _DeadError(DataError):
    """A worker process died."""


def _hire(context: SpawnContext, do: Callable[[Any], Any], job: Job) -> _Worker[Job]:
    near, far = context.Pipe()
    process = context.Process(target=_work, args=(far, do), daemon=True)
    process.start()
    far.close()
    near.send(job)
    return _Worker(process, near, job)


def _next_job(worker: _Worker[Job], waiting: Iterator[Job]) -> None:
    worker.job = next(waiting, None)
    if worker.job is not None:
        worker.link.send(worker.job)


def _words(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _received(worker: _Worker[Any]) -> Any:  # noqa: ANN401 - what the job gave
    try:
        failed, done = worker.link.recv()
    except (EOFError, OSError):
        worker.process.join(1.0)
        code = worker.process.exitcode
        raise _DeadError(f"a worker process died (exit code {code}); is there memory for --workers?") from None
    if failed:
        raise done
    return done


def _work(link: Connection, do: Callable[[Any], Any]) -> None:
    """A worker process: jobs in, results out, until killed or the parent is gone."""
    for which in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):  # they reach the whole group; the parent decides
        signal.signal(which, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, daemon=True).start()
    try:
        while True:
            job = link.recv()
            try:
                answer = False, do(job)
            except Exception as error:
                answer = True, error
            link.send(answer)
    except (EOFError, OSError):
        return


def _die_with_parent() -> None:
    """Without it a worker whose parent was killed flies its job to the end."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # this is a worker
    multiprocessing.connection.wait([parent.sentinel])
    os._exit(1)
