"""The one exception family. Every message says what was wrong, what was expected and what to do."""


class ShiplandError(Exception):
    """Base of every error that shipland raises on purpose; the command line prints it as one line, exit 2."""


class ConfigError(ShiplandError):
    """A configuration file, key or value is wrong."""


class DataError(ShiplandError):
    """A picture, video, calibration, table or log cannot be used."""


class SystemLibraryError(ShiplandError):
    """The machine lacks a system library; the message names the package to install."""


class VehicleError(ShiplandError):
    """A vehicle or its link cannot be opened."""
