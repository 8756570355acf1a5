"""`shipland verify`: whether a bundle is what it says."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import PathArgument, say
from shipland.errors import ConfigError


@dataclass(frozen=True)
class Verify:
    """Check a bundle, and fly a sample of its rows again.

    Every number must come out as it is stored. Checked first, without a flight: files against their digests, rows
    against the summary, seeds, the suite's cells, logs. A bundle that is not what it says is refused with one line
    that says what and where; exit code 2. Flying again wants the code that flew, to the digit, and best the same
    processor and libraries.

    A bundle may hold a pilot or vision of the submitter's own. It runs with your rights and nothing stands around it:
    read it, and verify on a machine that may be lost.

    Example: shipland verify mine.zip --sample 20

    Example: shipland verify sealed.zip --salt salt.txt --sample 0 --workers 8
    """

    bundle: PathArgument
    """The zip that `shipland submit` wrote."""
    sample: int = 10
    """Flights to fly again, drawn from all; 0: every one."""
    sample_seed: int | None = None
    """Draws the sample; one that the submitter cannot know when not given."""
    salt: Path | None = None
    """File with the secret of sealed seeds."""
    run_own_code: bool = False
    """Run the code in the bundle."""
    no_flight: bool = False
    """Check without flying."""
    workers: int = 2
    """Processes."""

    def run(self) -> int:
        """Check, fly, and say what was found."""
        import secrets

        import numpy as np

        from shipland.evaluation.bundle import opened
        from shipland.evaluation.verify import check_code, fly_again, own_code, write_receipt

        if self.workers < 1 or self.sample < 0:
            raise ConfigError(f"expected --workers 1 or more and --sample 0 or more, got {self.workers}, {self.sample}")
        with opened(self.bundle, self.salt) as bundle:
            foreign = sorted(set(bundle.about["own_code"].values()))
            for note in bundle.notes:
                say(f"note: {note}")
            if self.no_flight:
                print(f"{bundle.title}: {len(bundle.flights)} rows are consistent; none was flown again")
                return 0
            check_code(bundle)
            if foreign and not self.run_own_code:
                raise ConfigError(
                    f"flying it again runs the submitter's {', '.join(foreign)} with your rights: unzip it, read it, "
                    "then give --run-own-code"
                )
            seed = secrets.randbits(48) if self.sample_seed is None else self.sample_seed
            say(f"flying a sample again: --sample {self.sample} --sample-seed {seed}")
            with own_code(bundle) if foreign else nullcontext():
                found = fly_again(bundle, self.sample, np.random.default_rng(seed), self.workers)
        write_receipt(self.bundle, found)
        print(
            f"{bundle.title}: {found.again} of {found.flights} rows flown again, every number as it is stored; had one "
            f"row in ten been altered, the sample would have missed it in {100 * found.missed(0.1):.2g} % of draws"
        )
        return 0
