"""What a campaign hides."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Hidden:
    """One hidden cause: its name, the response that shows it best, its SNR and the names that count as right."""

    effect: str
    response: str
    snr: float
    detectability: float  # standard deviations by which a matched filter sees it in this noise
    right_names: dict[str, str]  # name -> why it counts


@dataclass(frozen=True)
class Truth:
    """The whole truth of a campaign; `clean` and `noise` (per run, on the record's rows) stay in memory only."""

    seed: int
    kind: str
    hidden: tuple[Hidden, ...]
    verdicts: tuple[str, ...]
    floor: dict[str, float]  # rms of the true noise, each run's offset and initial state taken out
    own_floor: dict[
        str, float
    ]  # the same, the initial state of the frequency alone: bias and 1/Q have none in the contract
    noise_family: dict[str, str]
    protocols: tuple[str, ...]
    tolerated: tuple[str, ...]  # small real departures of the device; naming them beside the cause is no error
    departure_sd: float  # of the bare device from the baseline, over white noise of the same rms, all rows together
    files: tuple[str, ...]
    sampling_s: float
    starts_known: bool
    main_s: float  # the lag of the baseline
    memory_s: float  # of noise `ar1`
    clean: list[dict[str, np.ndarray]] = field(default_factory=list, repr=False, compare=False)
    noise: list[dict[str, np.ndarray]] = field(default_factory=list, repr=False, compare=False)
    bare: list[dict[str, np.ndarray]] = field(default_factory=list, repr=False, compare=False)

    def write(self, path: Path) -> None:
        public = {k: v for k, v in asdict(self).items() if k not in ("clean", "noise", "bare")}
        path.write_text(json.dumps(public, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
