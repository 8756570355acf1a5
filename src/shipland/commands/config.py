"""`shipland config`: what a scenario is configured to, with unit, meaning and source of every key."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.commands.options import NameArgument, ScenarioOptions
from shipland.errors import ConfigError


@dataclass(frozen=True)
class Config(ScenarioOptions):
    """Print the merged configuration of a scenario, as TOML that can be flown: value, unit, meaning, source.

    Above each value stand what it means, its unit, the packaged default where that is another, the file that gives it
    and the comment there, which names the source.

    Example: shipland config near wind --set wind.mean_mps=5
    """

    scenario: NameArgument = "near"
    """Packaged scenario (see `shipland scenarios`), or the path of a TOML file laid over the defaults."""
    key: NameArgument = ""
    """Print only keys that begin with this, as `wind` or `guidance.horizon.path`."""
    changed: bool = False
    """Print only keys whose value is not the packaged default."""

    def run(self) -> int:
        """Print them."""
        from difflib import get_close_matches

        from shipland.report.configuration import as_toml, scenario_settings

        settings = scenario_settings(self.scenario, self.config, self.changes)
        inside = [setting for setting in settings if setting.key.startswith(self.key)]
        if not inside:
            near = get_close_matches(self.key, [setting.key for setting in settings], n=1, cutoff=0.0)[0]
            raise ConfigError(f"no key begins with {self.key!r}; did you mean {near!r}?")
        print(as_toml(setting for setting in inside if setting.differs or not self.changed))
        return 0
