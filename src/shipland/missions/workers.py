"""Flights on several cores: processes that are stopped at once when asked, and whose finished flights are kept."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from types import FrameType
from typing import Any, Generic, TypeVar

from shipland.errors import DataError

Job = TypeVar("Job")
Done = TypeVar("Done")


@dataclass
class _Worker(Generic[Job]):
    process: BaseProcess
    link: Connection
    job: Job | None = None


def run_jobs(
    do: Callable[[Job], Done], jobs: Iterable[Job], workers: int, keep: Callable[[Job, Done], None]
) -> Iterator[tuple[Job, Done]]:
    """Yield every job with what came of it, in the order in which they finish.

    With one worker the jobs run here. With more, each has a process of its own. When the iteration ends early for any
    reason, what has finished is still kept, and the processes are killed.

    Args:
        do: the work; a function of a module, because it is pickled, and so are jobs and results.
        jobs: what to do, one after another.
        workers: processes.
        keep: called here with every finished job, before it is yielded.

    Raises:
        DataError: a worker process died, for instance for want of memory.
        Exception: whatever `do` raised.
    """
    if workers == 1:
        for job in jobs:
            done = do(job)
            keep(job, done)
            yield job, done
        return
    # spawn: an OpenGL context does not survive a fork
    context = multiprocessing.get_context("spawn")
    waiting = iter(jobs)
    crew: list[_Worker[Job]] = []
    try:
        for job in waiting:
            near, far = context.Pipe()
            process = context.Process(target=_work, args=(far, do), daemon=True)
            process.start()
            far.close()
            near.send(job)
            crew.append(_Worker(process, near, job))
            if len(crew) == workers:
                break
        while busy := [worker for worker in crew if worker.job is not None]:
            ready = multiprocessing.connection.wait([worker.link for worker in busy])
            for worker in busy:
                if worker.link in ready and worker.job is not None:
                    job, done = worker.job, _received(worker)
                    keep(job, done)
                    worker.job = next(waiting, None)
                    if worker.job is not None:
                        worker.link.send(worker.job)
                    yield job, done
    finally:
        for worker in crew:
            if worker.job is not None and worker.link.poll():
                with suppress(Exception):  # one that failed or died is flown again
                    keep(worker.job, _received(worker))
            worker.process.kill()
        for worker in crew:
            worker.process.join()


def _received(worker: _Worker[Any]) -> Any:  # noqa: ANN401 - what the job gave
    try:
        failed, done = worker.link.recv()
    except (EOFError, OSError):
        worker.process.join(1.0)
        code = worker.process.exitcode
        raise DataError(f"a worker process died (exit code {code}); is there memory for --workers?") from None
    if failed:
        raise done
    return done


def _work(link: Connection, do: Callable[[Any], Any]) -> None:
    """A worker process: jobs in, results out, until killed or the other end is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
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


@contextmanager
def stoppable() -> Iterator[None]:
    """SIGTERM interrupts as Ctrl-C does, within the block and in the main thread."""

    def interrupt(_signal: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
