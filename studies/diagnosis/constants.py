"""The engine's constants, all in `calibration.toml`, each with its reason."""

import tomllib
from pathlib import Path

CONSTANTS: dict[str, float] = {
    name: float(entry["value"])
    for name, entry in tomllib.loads((Path(__file__).parent / "calibration.toml").read_text())["constant"].items()
}
"""Value of every constant by name."""
