"""Work on several cores: processes that are stopped when asked, and whose finished jobs are kept.

A worker is an interpreter of its own that gets jobs over a socket. It does not run the caller's script again, as
multiprocessing's does, so that a script needs no guard and a notebook works too; what the script or the notebook itself
defines travels by value.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

import cloudpickle

from shipland.errors import DataError
from shipland.stopping import check_stop

Job = TypeVar("Job")
Done = TypeVar("Done")


@dataclass
class _Worker(Generic[Job]):
    process: subprocess.Popen[bytes]
    link: Connection
    job: Job | None = None


def run_jobs(
    do: Callable[[Job], Done],
    jobs: Iterable[Job],
    workers: int,
    keep: Callable[[Job, Done], None],
    lose: Callable[[Job, str], None],
) -> Iterator[tuple[Job, Done]]:
    """Yield every job with what came of it, in the order in which they finish.

    With one worker the jobs run here. With more, each has a process of its own; no more jobs are taken from `jobs` than
    there are workers. When the iteration ends early for any reason, what has finished is still kept, and the processes
    are killed. Within `stop_requests` a request ends it.

    Args:
        do: the work; it is pickled by value where the caller's script defines it, and so are jobs and results.
        jobs: what to do, one after another.
        workers: processes.
        keep: called here with every finished job, before it is yielded.
        lose: called here with a job that raised or whose process died, and why; a process that died is replaced.

    Raises:
        DataError: `_DEATHS` worker processes died one after another, for instance for want of memory; or work cannot be
            sent to them.
    """
    if workers == 1:
        for job in jobs:
            check_stop()
            try:
                done = do(job)
            except Exception as error:
                lose(job, _words(error))
                continue
            keep(job, done)
            yield job, done
        return
    waiting = iter(jobs)
    hired: list[_Worker[Job]] = []
    deaths = 0
    try:
        hired.extend(_hire(do, job) for job in itertools.islice(waiting, workers))
        while busy := [worker for worker in hired if worker.job is not None]:
            ready = wait([worker.link for worker in busy], POLL_S)
            check_stop()
            for worker in busy:
                if worker.link not in ready or worker.job is None:
                    continue
                job = worker.job
                try:
                    good, done = _received(worker)
                except _DeadError as error:
                    deaths += 1
                    if deaths >= _DEATHS:
                        raise
                    lose(job, str(error))
                    hired.remove(worker)
                    hired.extend(_hire(do, another) for another in itertools.islice(waiting, 1))
                    continue
                deaths = 0
                (keep if good else lose)(job, done)
                worker.job = next(waiting, None)
                if worker.job is not None:
                    _send(worker, _pickled(worker.job))
                if good:
                    yield job, done
    finally:
        for worker in hired:
            if worker.job is not None and worker.link.poll():
                with suppress(Exception):  # one that failed or died is done again
                    good, done = _received(worker)
                    if good:
                        keep(worker.job, done)
            worker.process.kill()
        for worker in hired:
            worker.process.wait()


POLL_S = 0.2
"""How often a loop that waits for results looks for a request to stop."""
_DEATHS = 5
"""Worker processes that die one after another: it is not the jobs."""


class _DeadError(DataError):
    """A worker process died."""


def _hire(do: Callable[[Any], Any], job: Job) -> _Worker[Job]:
    sent = _pickled(do), _pickled(job)
    near, far = multiprocessing.Pipe()
    with far:  # not a fork: an OpenGL context does not survive it
        code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import _work; _work({far.fileno()})"
        command = [sys.executable, "-c", code]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=[far.fileno()])  # noqa: S603 - ourselves
    worker = _Worker(process, near, job)
    for data in sent:
        _send(worker, data)
    return worker


def _pickled(work: object) -> bytes:
    try:
        return bytes(cloudpickle.dumps(work))
    except Exception as error:
        raise DataError(
            f"this cannot be sent between processes: {_words(error)}; fly with one worker, or put pilot and vision "
            "into a file and give module:factory"
        ) from error


def _send(worker: _Worker[Any], data: bytes) -> None:
    with suppress(OSError):  # it has died: its answer says so
        worker.link.send_bytes(data)


def _words(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _received(worker: _Worker[Any]) -> tuple[bool, Any]:
    """Whether the job was done, and the result or what went wrong in words."""
    try:
        data = worker.link.recv_bytes()
    except (EOFError, OSError):
        with suppress(subprocess.TimeoutExpired):
            worker.process.wait(1.0)
        code = worker.process.returncode
        raise _DeadError(f"a worker process died (exit code {code}); is there memory for so many workers?") from None
    good, done = cloudpickle.loads(data)
    return good, done


def _work(descriptor: int) -> None:
    """A worker process: the work and its jobs in, results out, until killed or the parent is gone."""
    for which in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):  # they reach the whole group; the parent decides
        signal.signal(which, signal.SIG_IGN)
    threading.Thread(target=die_with_parent, args=(descriptor,), daemon=True).start()
    link = Connection(descriptor)
    try:
        do = cloudpickle.loads(link.recv_bytes())
        while True:
            job = link.recv_bytes()
            try:
                answer = _pickled((True, do(cloudpickle.loads(job))))
            except Exception as error:
                answer = _pickled((False, _words(error)))
            link.send_bytes(answer)
    except (EOFError, OSError):
        return


def die_with_parent(descriptor: int) -> None:
    """End this process when the parent's end of a socket or pipe is closed: else its job goes on when it was killed."""
    parent = select.poll()
    parent.register(descriptor, 0)  # nothing but the other end's being closed
    parent.poll()
    os._exit(1)
