"""`python -m studies`: run studies, or list them."""

from __future__ import annotations

import sys
from typing import Annotated

import tyro

from studies import ORDER
from studies.harness import listing, load, run
from studies.tables import update_pages


def main(
    names: Annotated[tuple[str, ...], tyro.conf.Positional] = (),
    *,
    runs: int | None = None,
    workers: int = 2,
    list_only: Annotated[bool, tyro.conf.arg(name="list")] = False,
) -> None:
    """Run studies into results/NAME.json, then write the tables of README and docs anew.

    Run the command again to resume. With another number of runs than the study's own the results go to out/studies/.

    Args:
        names: studies; all of them, in their order, by default.
        runs: repetitions a case; the study's own by default.
        workers: processes.
        list_only: print each study's question, size and duration, and run nothing.
    """
    if unknown := set(names) - set(ORDER):
        raise SystemExit(f"studies: no study is called {', '.join(sorted(unknown))}; there are: {', '.join(ORDER)}")
    if runs is not None and runs < 1:
        raise SystemExit(f"studies: --runs is {runs}; at least 1 was expected")
    chosen = [name for name in ORDER if not names or name in names]
    if list_only:
        print(listing(chosen))
        return
    for name in chosen:
        if not run(name, load(name), runs, workers):
            print(f"studies: stopped in {name}; run the command again to resume", file=sys.stderr)
            raise SystemExit(130)
    for page in update_pages():
        print(f"tables written anew: {page}")


if __name__ == "__main__":
    tyro.cli(main)
