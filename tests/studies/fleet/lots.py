"""Lots of virtual gyros: values drawn about a lot's mean, some devices odd and a batch bad, in the layout of `hrg fleet`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.calibration.priors import gather_priors
from studies.instrument.card import Instrument, load_card
from studies.record import write_record
from studies.simulation.chamber import load_profile
from studies.simulation.virtual_gyro import simulate_run

CARD = "hrg-30mm"
RUN = "soak 20 10min then ramp 20 40 1.5 then soak 40 45min then ramp 40 5 1.5 then soak 5 40min"
KEPT = ("time_s", "housing_temperature_degC", "frequency_Hz", "bias_deg_per_h", "inverse_q")
SCATTER = 0.05
"""Scatter of every value from device to device, in parts of the card's own uncertainty."""
ODD: tuple[Mapping[str, Any], ...] = (
    {"values": {"thermal.mount_conductance_W_per_K": 3.0}},
    {"effect": {"name": "jump", "response": "frequency_Hz", "run": 0, "time_s": 4000.0, "step_Hz": 0.1}},
    {"values": {"loss.inverse_q": 1.8}},
    {"values": {"material.deviation.shear_modulus.log_value": 1.0}},
    {"effect": {"name": "hysteresis", "response": "bias_deg_per_h", "half_width_K": 4.0, "loop_deg_per_h_per_K": 2.0}},
)
"""What is odd about devices in turn: values times so much (the shear modulus: one standard deviation more), or an effect."""
BAD: Mapping[str, float] = {"loss.inverse_q": 2.2}
"""What is wrong with a bad batch."""


@dataclass(frozen=True)
class Lot:
    """What was planted."""

    serials: tuple[str, ...]
    odd: tuple[str, ...]
    batch: str
    batches: Mapping[str, str] = field(default_factory=dict)


def make_lot(
    folder: Path,
    count: int,
    odd: Sequence[int],
    bad: Sequence[int],
    seed: int,
    batch_size: int,
    runs: Sequence[str] = (RUN,),
    columns: Sequence[str] = KEPT,
    row: float = 60.0,
    card: str = CARD,
) -> Lot:
    """Write a lot of `count` devices: those of numbers `odd` are odd in turn, those of numbers `bad` are the bad batch."""
    drawn_from, rng = load_card(card), np.random.default_rng(seed)
    priors = gather_priors(drawn_from)
    p = len(priors.values)
    mean = 0.5 * rng.standard_normal(p)
    serials, batches = [], {}
    for k in range(count):
        serial = f"G{k + 1:03d}"
        serials.append(serial)
        batches[serial] = "bad" if k in bad else f"b{k // batch_size + 1}"
        values = priors.at(priors.inside(mean + SCATTER * rng.standard_normal(p)))
        if k in bad:
            values |= {name: times * values[name] for name, times in BAD.items()}
        said = ODD[list(odd).index(k) % len(ODD)] if k in odd else {}
        gyro = _gyro(drawn_from, values, said, priors)
        (folder / serial).mkdir(parents=True)
        for number, words in enumerate(runs):
            record = simulate_run(gyro, load_profile(words), 1.0 / row, 1000 * seed + 10 * k + number).record
            own = {name: record[name] for name in columns}
            write_record(replace(record, columns=own, instrument=""), folder / serial / f"run{number + 1}.csv")
    lines = [f"{s},2024-{1 + k // 28 % 12:02d}-{1 + k % 28:02d},{batches[s]}" for k, s in enumerate(serials)]
    (folder / "lot.csv").write_text("serial,date,batch\n" + "\n".join(lines) + "\n")
    return Lot(tuple(serials), tuple(serials[k] for k in odd), "bad" if bad else "", batches)


def _gyro(card: Instrument, values: dict[str, float], said: Mapping[str, Any], priors: Any) -> Instrument:
    sd = {value.name: value.sd for value in priors.values}
    for name, times in said.get("values", {}).items():
        values[name] = (
            values[name] + times * sd[name] if values[name] <= 0 or "material" in name else times * values[name]
        )
    gyro = card.with_values(values)
    return gyro.with_table("effect", [said["effect"]]) if "effect" in said else gyro
