"""`shipland compare`: two campaigns, or two cells, seed by seed."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.commands.options import PathArgument


@dataclass(frozen=True)
class Compare:
    """Compare two folders that flew the same seeds: who landed where the other did not, and the touchdown errors.

    Of two campaigns with several cells the cells in common are compared, a line each: two versions of the code, for
    instance.

    Prints McNemar's exact test and a paired bootstrap of the difference of the median errors.

    Example: shipland compare out/campaign/near_paper out/campaign/near_horizon

    Example: shipland compare out/before out/after
    """

    first: PathArgument
    """Folder of a campaign, or of a cell in one."""
    second: PathArgument
    """Folder of another."""

    def run(self) -> int:
        """Print the comparison."""
        from shipland.evaluation.campaign import cells_file, read_cells
        from shipland.evaluation.folder import read_campaign
        from shipland.evaluation.leaderboard import campaign_pairings, pairings_table
        from shipland.evaluation.tables import comparison

        folders = (self.first, self.second)
        if all(cells_file(folder).exists() for folder in folders):
            print(pairings_table(campaign_pairings(read_cells([self.first]), read_cells([self.second]))))
            return 0
        # what is no campaign at all is named first
        read = {folder: read_campaign(folder) for folder in sorted(folders, key=lambda it: cells_file(it).exists())}
        print(comparison(read[self.first], read[self.second], (str(self.first), str(self.second))))
        return 0
