"""The loops of a card for control design: A, B, C, D of the wave and of the closed loops, and each loop's transfer function.

One object, schema `hrg.state-space/1`, as JSON or as variables of a .mat file of the same names:

    card, mode, frequency_Hz: of which gyro
    wave      ẋ = A x + B u, y = C x + D u, continuous: the demodulated wave, its pick-offs over the commanded amplitude
    loops     x[k+1] = A x[k] + B u[k], y[k] = C x[k] + D u[k], `step_s` apart: wave and controllers together, u held over a sample
    transfer  by loop: `open` L(z) and `closed` L/(1 + L), each `numerator` and `denominator`, the highest power of z first; of L also
              `zeros`, `poles` and `gain`, which are exact near z = 1

Each system has `states`, `inputs` and `outputs` by name and unit. Commands are forces over 2 ω and the amplitude (1/s).
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from compensation.arrays import Array
from compensation.closed_loop import ClosedLoop, real_form
from compensation.controllers import Loops, held
from studies.errors import InputError
from studies.files.writing import write_text, written_whole

if TYPE_CHECKING:
    from studies.simulation.loop_study import LoopStudy

PICKOFFS = ("antinode_real", "antinode_imaginary", "node_real", "node_imaginary")
RATE = "rate_rad_per_s"


def state_space(study: "LoopStudy") -> dict[str, Any]:
    """Return both systems and the transfer functions of a card's loops."""
    loop = study.closed()
    return {
        "schema": "hrg.state-space/1",
        "card": study.instrument.name,
        "mode": "whole-angle" if loop.turning else "force-rebalance",
        "frequency_Hz": study.frequency,
        "wave": wave_system(loop, study.wave.coupling),
        "loops": loops_system(loop, study.wave.coupling),
        "transfer": {margin.loop: transfer(study.loops, margin.loop, study.decay) for margin in study.margins},
    }


def wave_system(loop: ClosedLoop, coupling: float) -> dict[str, Any]:
    """Return the averaged wave: commands of the four loops and the rate in, demodulated pick-offs out."""
    rate = np.zeros((4, 1))
    rate[2] = coupling  # of the node, in phase with the antinode
    B = np.hstack([loop.drive_map, rate])
    return {
        "A": real_form(loop.A),
        "B": B,
        "C": real_form(loop.pickoff),
        "D": np.zeros((4, B.shape[1])),
        "states": PICKOFFS,
        "inputs": (*_commands(), RATE),
        "outputs": tuple(f"pickoff_{name}" for name in PICKOFFS),
    }


def loops_system(loop: ClosedLoop, coupling: float) -> dict[str, Any]:
    """Return the closed loops, sampled: the rate, what else drives the wave, and errors of the pick-offs in; commands and rate out."""
    F, at, kept = loop.sample[0], loop.places, loop.kept
    named = [
        f"{part}_{k}"
        for part in ("wave", "filtered", "integral", "sent")
        for k in range(at[part].stop - at[part].start)
    ]
    every = np.r_[at["wave"], at["filtered"], at["integral"], at["sent"]]
    forcing, offset = np.r_[at["forcing"]], np.r_[at["offset"]]
    rows = np.r_[at["sum"]]  # the command of the sample
    forced = np.hstack([coupling * F[:, forcing[2:3]], F[:, forcing], F[:, offset]])
    B, C, D = forced[kept], F[np.ix_(rows, kept)], forced[rows]
    inputs = (RATE, *(f"forcing_{name}_per_s" for name in PICKOFFS), *(f"pickoff_error_{name}" for name in PICKOFFS))
    outputs = (*_commands(), f"measured_{RATE}")
    C, D = np.vstack([C, -C[2] / coupling]), np.vstack([D, -D[2] / coupling])
    if loop.turning:  # a wave that turns freely holds no rate
        B, C, D, inputs, outputs = B[:, 1:], C[:-1], D[:-1, 1:], inputs[1:], outputs[:-1]
    states = tuple(name for name, place in zip(named, every, strict=True) if place in kept)
    found = {"A": F[np.ix_(kept, kept)], "B": B, "C": C, "D": D, "step_s": loop.loops.step}
    return {**found, "states": states, "inputs": inputs, "outputs": outputs}


def transfer(loops: Loops, name: str, decay: float) -> dict[str, dict[str, Array | float]]:
    """Return L(z) of one loop alone, and L/(1 + L); L = (g z + l) a (K (z − 1) + K_i T) / [z^m (z − e^{−dT}) (z − 1 + a) (z − 1)]."""
    d, T, (whole, rest) = 0.0 if name == "phase" else decay, loops.step, loops.late
    K, K_i = loops.gains(name)
    a = loops.smoothing
    ahead = [held(d, T - rest), np.exp(-d * (T - rest)) * held(d, rest)]
    zeros = np.array([-ahead[1] / ahead[0], 1 - K_i * T / K])
    poles = np.array([np.exp(-d * T), 1 - a, 1.0, *np.zeros(whole)])
    gain = a * K * ahead[0]
    above, below = gain * np.poly(zeros), np.poly(poles)
    return {
        "open": {"zeros": zeros, "poles": poles, "gain": gain, "numerator": above, "denominator": below},
        "closed": {"numerator": above, "denominator": np.polyadd(above, below)},
    }


def write_state_space(study: "LoopStudy", path: str) -> None:
    """Write the systems to a .json or a .mat file, whole or not at all."""
    from scipy.io import savemat

    from studies.cli.output import dump_json

    ending = Path(path).suffix
    if ending not in (".json", ".mat"):
        raise InputError(f"--state-space {path}: name a file that ends with .json or .mat.")
    found = state_space(study)
    if ending == ".json":
        write_text(path, dump_json(found))
        return
    with written_whole(path) as file:
        savemat(file, _cells(found), oned_as="row")  # type: ignore[arg-type]


def _cells(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _cells(item) for key, item in value.items()}
    return np.array(value, dtype=object) if isinstance(value, tuple) else value


def _commands() -> tuple[str, ...]:
    return tuple(f"command_{name}_per_s" for name in Loops.NAMES)
