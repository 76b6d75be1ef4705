"""Writes the records, the card and the truth of a campaign."""

import datetime
from pathlib import Path

import numpy as np

from tests.stranger.baseline import COLUMN
from tests.stranger.protocol import Run
from tests.stranger.truth import Truth

CARD = """schema = "hrg.card/1"
name = "stranger"
reference_temperature_degC = 20.0

[resonator]
shape = "hemisphere"
radius_mm = 15.0
thickness_mm = 0.8558278
support = "stem"

[resonator.stem]
radius_mm = 2.5
end_mm = -5.0
side = "inner"
fillet_mm = 0.5

[material]
name = "fused-silica"
"""


def write_campaign(folder: Path, truth: Truth, runs: list[Run], times: list[np.ndarray], sigma: dict[str, float],
                   begin: datetime.datetime | None, reference: bool, rng: np.random.Generator) -> None:  # fmt: skip
    """Add sensor noise, outliers, empty cells and rounding; write everything into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    outliers = rng.uniform(2e-4, 3e-3) if rng.random() < 0.35 else 0.0
    empty = rng.uniform(0, 5e-3) if rng.random() < 0.3 else 0.0
    chamber = rng.random() < 0.5
    digits = {r: int(np.ceil(-np.log10(s * rng.uniform(0.05, 0.3)))) for r, s in sigma.items()}
    for i, (run, time) in enumerate(zip(runs, times, strict=True)):
        columns = {"time_s": _text(time, 3)}
        reading = truth.clean[i]["reading"] + rng.normal(0, 0.0005, len(time))
        columns["housing_temperature_degC"] = _text(reading, 3)
        if chamber:
            columns["chamber_temperature_degC"] = _text(np.interp(time, run.time, run.chamber), 2)
        before = np.searchsorted(run.time, time, side="right") - 1
        steps = [np.diff(v, append=v[-1]) != 0 for v in run.drive.values()]
        settling = np.any(steps, axis=0)[before] if steps else np.zeros(len(time), bool)
        for response, noise in truth.noise[i].items():
            values = truth.clean[i][response] + noise
            hit = rng.random(len(time)) < outliers
            values = values + hit * rng.choice([-1, 1], len(time)) * rng.uniform(8, 30, len(time)) * sigma[response]
            values[rng.random(len(time)) < empty] = np.nan
            for _ in range(rng.poisson(0.4)):
                begun = rng.uniform(0, 0.9) * time[-1]
                values[(time > begun) & (time < begun + rng.uniform(100, 2400))] = np.nan
            values[settling] = np.nan  # the loop has lost its hold in the seconds in which a drive is changed
            columns[COLUMN[response]] = _text(values, digits[response])
        if reference:
            values = (
                truth.clean[i]["reference"]
                + truth.noise[i]["frequency"]
                + rng.normal(0, 0.05 * sigma["frequency"], len(time))
            )
            columns["reference_frequency_Hz"] = _text(values, digits["frequency"])
        for name, values in run.drive.items():
            columns[name] = _text(values[before], 3)
        lines = ["# source: an independent generator"]
        if begin is not None:
            lines.append(f"# start: {(begin + datetime.timedelta(seconds=run.start)).isoformat()}")
        lines += [",".join(columns), *map(",".join, zip(*columns.values(), strict=True))]
        (folder / truth.files[i]).write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "card.toml").write_text(CARD, encoding="utf-8")
    truth.write(folder / "truth.json")


def _text(values: np.ndarray, digits: int) -> list[str]:
    return (f"%.{digits}f " * len(values) % tuple(values)).replace("nan", "").split(" ")[:-1]
