"""`hrg loads`: what acceleration, rotation, pressure and an uneven temperature do to a held resonator."""

from math import pi, radians
from typing import Annotated, Any

import numpy as np

from shell.constants import zero_Celsius
from shell.damping.gas import GASES, Gas
from shell.duffing import amplitude_shift
from shell.gas_inertia import gas_shift
from shell.loads import Kind, Loads
from shell.modes import Mode, solve_modes
from shell.spin import SpinShift, spin_shift
from studies.cli.arguments import (
    POSITIVE,
    WHOLE,
    Card,
    FromDegC,
    Harmonic,
    Step,
    Temperature,
    ToDegC,
    lay_temperatures,
    open_card,
)
from studies.cli.output import answers
from studies.errors import InputError, naming
from studies.instrument.card import Instrument
from studies.resonator.loads import STANDARD_GRAVITY, bias_by_tilt, loads_of, shift_per_kelvin
from studies.results import Fact, Facts, Result, Table, row_of

LINEAR = 0.1  # strain and relative shift of f: no solid bears so much (ideal strength E/10), nor is it a small change
ABROAD = (
    "Shift of the mean frequency of the pair, in the frame of the resonator. An acceleration across the axis shifts it only in second order."
    " Stresses: the largest tensile and the largest von Mises stress in the wall{root}; at sharp corners and at the clamp a linear elastic stress is not finite, so they are not counted."
)
COLUMNS = (
    "load | amount: amount .6g | unit | shift_ppm: shift of f (ppm) +.4g | tension_MPa: largest tension (MPa) .3"
    " | mises_MPa: von Mises (MPa) .3 | part: where | rim_axial_um: rim along the axis (µm) +.3g | rim_lateral_um: rim across (µm) +.3g | rim_tilt_urad: tilt of the rim (µrad) +.3g"
)


@answers("hrg.loads/1")
def loads(
    card: Card,
    *,
    along: float = 1.0,
    across: float = 1.0,
    rotation: float = 0.0,
    pressure: Annotated[float, WHOLE] = 0.0,
    gradient: float = 0.0,
    strength: Annotated[float | None, POSITIVE] = None,
    harmonic: Harmonic = 2,
    temperature: Temperature = None,
    from_degC: FromDegC = -20.0,
    to_degC: ToDegC = 40.0,
    step: Step = 30.0,
) -> Result:
    """Show frequency shift, stress and displacement of a held resonator under loads, its sensitivity to 1 g, and Duffing's coefficient.

    Args:
        along: Acceleration of the base along the axis, from rim to pole of a dome, in g; 1: the gyro stands upright.
        across: Acceleration of the base across the axis in g.
        rotation: Rate of rotation about the axis in °/s.
        pressure: Pressure of the gas around the resonator in kPa: its stress, and the inertia of the gas that moves with the wall
            where it is free on both sides; the gas is that of [loss] gas, air unless given.
        gradient: Temperature of the base minus that of the free end in °C, linear along the meridian.
        strength: Strength in MPa that the largest stress is compared with.
    """
    instrument, T = open_card(card, temperature)
    if harmonic < 2:
        raise InputError(f"--harmonic {harmonic}: the effects of loads are computed for n = 2 and above.")
    with naming(instrument.path):
        found = loads_of(instrument, T, harmonic)
        mode, elastic = found.mode, found.elastic
        g, alpha = STANDARD_GRAVITY, float(instrument.material.value("expansion", T)) if gradient else 0.0
        amounts: dict[str, tuple[Kind, float, str, float]] = {
            # load: kind, amount, unit, units of the solver in it
            "acceleration along the axis": ("axial", along, "g", g * along),
            "acceleration across the axis": ("lateral", across, "g", g * across),
            "rotation": ("spin", rotation, "°/s", radians(rotation) ** 2),
            "pressure": ("pressure", pressure, "kPa", 1e3 * pressure),
            "temperature of the base": ("cooling", gradient, "°C", alpha * gradient),
        }
        given = {name: one for name, one in amounts.items() if one[1]}
        if not given:
            raise InputError("no load is given; --along 1 is an acceleration of 1 g along the axis.")

        spin = spin_shift(mode, elastic) if rotation else None
        around = GASES[instrument.part("loss", "loss_parts").gas]
        moved = gas_shift(mode, around, 1e3 * pressure, T) if pressure else 0j

        def shift(kind: Kind, units: float) -> float:
            if kind == "spin":
                return units * spin.total if spin else 0.0
            if kind == "cooling":
                return gradient * shift_per_kelvin(instrument, found, T)
            return units * found.shift(kind) + (moved.real if kind == "pressure" else 0.0)

        every: dict[Kind, float] = {kind: units for kind, _, _, units in given.values()}
        shifts = {kind: shift(kind, units) for kind, units in every.items()}
        _check_small("relative shift of f", sum(map(abs, shifts.values())), LINEAR, "")
        rows = [
            {"load": name, "amount": amount, "unit": unit} | _under(found, {kind: units}, shifts[kind])
            for name, (kind, amount, unit, units) in given.items()
        ]
        whole = _under(found, every, sum(shifts.values()))
        most = 1e-6 * LINEAR * elastic.E
        _check_small("stress", max(whole["tension_MPa"], whole["mises_MPa"]), most, " MPa")
        if len(rows) > 1:
            rows.append({"load": "all together", "amount": None, "unit": ""} | whole)
        stem, tilted = found.beam(g * along, g * across), bias_by_tilt(instrument, found, T)
        nonlinear = _amplitudes(instrument, harmonic, lay_temperatures(from_degC, to_degC, step))
    waves = spin and _waves(mode, spin, radians(rotation))
    gas = _gas(found, around, 1e3 * pressure, T, moved) if pressure else None
    bias = row_of(tilted, "deg_per_h_per_g", "azimuth_deg", gap_nm_per_g=("gap", 1e9)) if tilted else None
    worst = max(whole["tension_MPa"], whole["mises_MPa"], 1e-6 * stem)
    safety = None if strength is None else strength / worst
    (upright, aside) = found.sag({"axial": g}), found.sag({"lateral": g})
    per_g = {
        "axial_ppb": 1e9 * g * found.shift("axial"),
        "rim_axial_nm": 1e9 * upright.axial,
        "rim_lateral_nm": 1e9 * aside.lateral,
        "tilt_urad": 1e6 * aside.tilt,
    }
    payload = {
        "card": instrument.name, "temperature_degC": T - zero_Celsius, "harmonic": harmonic,
        "frequency_Hz": mode.frequency, "loads": rows, "stem_MPa": 1e-6 * stem or None, "safety": safety,
        "per_g": per_g, "waves": waves, "gas": gas, "bias": bias, "amplitude": nonlinear,
    }  # fmt: skip
    beam = f"The stem as a beam has {1e-6 * stem:.3g} MPa at its clamped end, by its axial force and its bending moment under these accelerations."
    return Result(
        payload,
        f"Loads on {instrument.name}",
        f"Mode n = {harmonic} at {mode.frequency:.2f} Hz and {T - zero_Celsius:g} °C, to first order in each load.",
        [
            Facts(_facts(worst, strength, safety, per_g)),
            Table("Loads", rows, COLUMNS, ABROAD.format(root=" and at the root" if "root" in found.counted else "")),
            WAVES.format(**waves) if waves else None,
            GAS.format(**gas) if gas else None,
            beam if stem else None,
            _bias_words(instrument, bias),
            Table("Coefficient of the amplitude (Duffing)", nonlinear, AMPLITUDE, NONLINEAR),
        ],
    )  # fmt: skip


WAVES = (
    "Rotation: two travelling waves at {lower_Hz:.5f} and {upper_Hz:.5f} Hz in the frame of the resonator (Bryan's effect). Their mean shifts by"
    " {stress_ppm:+.3g} ppm by stress, {centrifugal_ppm:+.3g} by centrifugal softening and {coriolis_ppm:+.3g} by Coriolis forces."
)
GAS = (
    "Pressure: {elastic_ppm:+.4g} ppm by stress, and {inertia_ppm:+.4g} ppm by the inertia of {gas} ({density_kg_m3:.4g} kg/m³) that moves with the wall;"
    " the sound it radiates adds 1/Q = {sound_inverse_q:.2g}. The gas is taken as free on both sides. A surface that faces the wall at a distance g, as electrodes and"
    " housing do, is not included: it multiplies the inertia on its side by about {reach_mm:.3g} mm/g and keeps the sound in."
)
AMPLITUDE = (
    "temperature_degC: T (°C) .1f | shift_Hz_per_um2: shift per square of the largest displacement (Hz/µm²) +.5g"
    " | static_Hz_per_um2: static part (Hz/µm²) +.5g | inertial_Hz_per_um2: inertial part (Hz/µm²) +.5g | change_ppm_per_degC: relative change from the first row (ppm/°C) +.3g"
)
PARTS = {"shift": "total", "static": "static", "inertial": "inertial"}
NONLINEAR = (
    "Geometric nonlinearity of a standing wave: the static part stiffens, the inertia of the motion at twice the frequency softens. Third-order"
    " elastic constants, which may matter as much in thick shells, and electrostatic springs are not included."
)


def _check_small(what: str, found: float, most: float, unit: str) -> None:
    """Refuse loads beyond the first order, where the answers are proportional to them."""
    if not found < most:
        raise InputError(f"these loads would cause a {what} of {found:.3g}{unit}; the theory is linear and does not hold from {most:.3g}{unit} up. Lower them.")  # fmt: skip


def _waves(mode: Mode, spin: SpinShift, omega: float) -> dict[str, float]:
    """The travelling waves f + shift ± g Ω/2π, g = n K of Bryan's factor K, in the frame of the resonator."""
    mean = mode.frequency * (1 + spin.total * omega**2)
    apart = mode.harmonic * abs(mode.bryan_factor * omega) / (2 * pi)
    ppm = {f"{name}_ppm": (name, 1e6 * omega**2) for name in ("stress", "centrifugal", "coriolis")}
    return {"lower_Hz": mean - apart, "upper_Hz": mean + apart} | row_of(spin, **ppm)


def _gas(found: Loads, gas: Gas, pressure: float, temperature: float, moved: complex) -> dict[str, Any]:
    """Parts of the shift by a gas; `reach_mm` R/n, how far it moves."""
    return {
        "gas": gas.name,
        "density_kg_m3": gas.density_at(pressure, temperature),
        "elastic_ppm": 1e6 * pressure * found.shift("pressure"),
        "inertia_ppm": 1e6 * moved.real,
        "sound_inverse_q": -2 * moved.imag,
        "reach_mm": 1e3 * found.mode.resonator.size / found.mode.harmonic,
    }


def _under(found: Loads, amounts: dict[Kind, float], shift: float) -> dict[str, Any]:
    peak, sag = found.peak(amounts), found.sag(amounts)
    return {
        "shift_ppm": 1e6 * shift,
        "tension_MPa": 1e-6 * peak.tension,
        "mises_MPa": 1e-6 * peak.mises,
        "part": peak.part,
        **row_of(sag, rim_axial_um=("axial", 1e6), rim_lateral_um=("lateral", 1e6), rim_tilt_urad=("tilt", 1e6)),
    }


def _amplitudes(instrument: Instrument, harmonic: int, temperatures: np.ndarray[Any, Any]) -> list[dict[str, float]]:
    rows: list[dict[str, float]] = []
    for T in instrument.material.check(temperatures):
        (mode,) = solve_modes(*instrument.at(float(T)), harmonic)
        unit, change = mode.frequency * 1e-12, 0.0
        row = row_of(amplitude_shift(mode), **{f"{name}_Hz_per_um2": (key, unit) for name, key in PARTS.items()})
        if rows:
            first = rows[0]
            change = 1e6 * (row["shift_Hz_per_um2"] / first["shift_Hz_per_um2"] - 1)
            change /= T - zero_Celsius - first["temperature_degC"]
        rows.append({"temperature_degC": float(T - zero_Celsius), **row, "change_ppm_per_degC": change})
    return rows


def _facts(worst: float, strength: float | None, safety: float | None, per_g: dict[str, float]) -> list[Fact]:
    margin = "no --strength given" if safety is None else f"safety {safety:.3g} of a strength of {strength:g} MPa"
    return [
        ("Largest stress", f"{worst:.3g} MPa", margin),
        ("Frequency per g along the axis", f"{per_g['axial_ppb']:+.3g} ppb", ""),
        ("Tilt of the rim per g across", f"{abs(per_g['tilt_urad']):.3g} µrad", f"shift {abs(per_g['rim_lateral_nm']):.3g} nm"),
    ]  # fmt: skip


def _bias_words(instrument: Instrument, bias: dict[str, float] | None) -> str:
    if bias is None:
        missing = "[loop] and charged [electrodes]" if instrument.loop is None else "charged [electrodes]"
        return f"The bias per g needs {missing} in the card."
    return (
        f"Bias by an acceleration across the axis: {bias['deg_per_h_per_g']:.3g} °/h per g, largest towards {bias['azimuth_deg']:.0f}°. The wall shifts"
        f" by {abs(bias['gap_nm_per_g']):.3g} nm per g within the electrodes; with unequal voltages or waves of the gap this splits the pair."
    )
