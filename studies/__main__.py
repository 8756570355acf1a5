"""`python -m studies`: run studies, or list them."""

from __future__ import annotations

import fnmatch
import os
import sys
from typing import Annotated

import tyro

from studies import ORDER
from studies.harness import cases_where, confirm, listing, load, run
from studies.tables import update_pages


def main(
    names: Annotated[tuple[str, ...], tyro.conf.Positional] = (),
    *,
    runs: int | None = None,
    workers: int = 2,
    where: tuple[str, ...] = (),
    confirm_only: Annotated[bool, tyro.conf.arg(name="confirm")] = False,
    list_only: Annotated[bool, tyro.conf.arg(name="list")] = False,
) -> None:
    """Run studies into results/NAME.json, then write the tables of README and docs anew.

    Run the command again to resume. With another number of runs than the study's own, or with --where, the
    results go to out/studies/.

    Args:
        names: studies, or patterns such as speed_*; all of them, in their order, by default.
        runs: repetitions a case; the study's own by default.
        workers: processes.
        where: COLUMN=VALUE or COLUMN=VALUE,VALUE, only the cases that have it.
        confirm_only: after a change that should move no figure, measure every tenth case of results of earlier code
            again; where all come out to the digit, the others are taken over. With --where, of these cases: the same
            command without --confirm measures the rest.
        list_only: print each study's question, size and duration, and run nothing.
    """
    if unknown := [pattern for pattern in names if not fnmatch.filter(ORDER, pattern)]:
        raise SystemExit(f"studies: no study is called {', '.join(unknown)}; there are: {', '.join(ORDER)}")
    if runs is not None and runs < 1:
        raise SystemExit(f"studies: --runs is {runs}; at least 1 was expected")
    if wrong := [each for each in where if "=" not in each]:
        raise SystemExit(f"studies: --where {wrong[0]}: COLUMN=VALUE was expected")
    if confirm_only and runs is not None:
        raise SystemExit("studies: --confirm measures the study's own number of runs; it goes without --runs")
    wanted = dict(each.split("=", 1) for each in where)
    chosen = [name for name in ORDER if not names or any(fnmatch.fnmatchcase(name, pattern) for pattern in names)]
    if list_only:
        print(listing(chosen))
        return
    for name in chosen:
        study = load(name)
        if missing := [variable for variable in study.needs if not os.environ.get(variable)]:
            print(f"studies: {name} is left out: {', '.join(missing)} names nothing", file=sys.stderr)
            continue
        if not cases_where(study, wanted):
            raise SystemExit(f"studies: no case of {name} has {' and '.join(where)}")
        if confirm_only:
            try:
                print(confirm(name, study, workers, wanted), flush=True)
            except KeyboardInterrupt:
                print(f"studies: stopped in {name}; nothing of it is taken over", file=sys.stderr)
                raise SystemExit(130) from None
            continue
        if not run(name, study, runs, workers, wanted):
            print(f"studies: stopped in {name}; run the command again to resume", file=sys.stderr)
            raise SystemExit(130)
    for page in update_pages():
        print(f"tables written anew: {page}")


if __name__ == "__main__":
    tyro.cli(main)
