"""Models of kind `scale`: the compensation chain (32)–(36) of the BVG paper, and its C code.

The file has the parts "rough" (null, scale), "bias", "scale_over_rate" and "scale_over_temperature" (c0, c1, c2 in °C
and °/s), and the settings `fir_taps` and `sampling_s` (empty and 0 without a filter) and `temperature_column`. With the setting
`rate_form`, "scale_over_rate" is that law of `compensation.rate_law`: a, k, and c, A, d or k_positive_more, in °/s; a dead band has
`blind_deg_per_s`, within which of its null the output tells no rate (NaN). With the setting `warming` (a, b in the unit of the output, g, turn in K) the
output is first rid of what differs while the temperature rises and falls. Ranges are those of the fit, widened by 5 % of their
length, because readings scatter; outliers, which the fit leaves out, are not judged.
"""

from dataclasses import astuple, replace

import numpy as np

from compensation.arrays import Array
from compensation.bell import BellChain, PolynomialCurve, Warming, apply_chain
from compensation.rate_law import FORMS, RateCurve
from studies.errors import InputError
from studies.models.c_source import head, polynomial, self_test, write_c
from studies.models.file import Known, Model, ModelPart, ModelSource, Setting, make_part, widen
from studies.record import COMPENSATED, Record
from studies.record.rest import drop_spikes

RAW = ("output_counts", "measured_rate_deg_per_s")
"""Columns that can be the raw output; the first needs the rough scale, the second is a rate already."""
RATE = "measured_rate_deg_per_s"
FORM, BLIND, WARMING = "rate_form", "blind_deg_per_s", "warming"
STEPS = {
    "bias": ("deg/s", "deg/s/degC", "deg/s/degC^2"),
    "scale_over_rate": ("deg/s", "1", "s/deg"),
    "scale_over_temperature": ("1", "1/degC", "1/degC^2"),
}
C_FORMS = {  # a rate law's own coefficient: its unit; and Ω over u = (y − a)/k in C
    "directions": ("1", "u / (u < 0.0 ? 1.0 : 1.0 + {s} / {k})"),
    "cubic": ("s^2/deg^2", "2.0 * {t} * ({s} > 0.0 ? sinh(asinh({w}) / 3.0) : sin(asin(fmax(-1.0, fmin(1.0, {w}))) / 3.0))"),
    "sine": ("deg/s", "{s} * asin(fmax(-1.0, fmin(1.0, u / {s})))"),
    "dead band": ("deg/s", "fabs(u) < {blind} ? NAN : u + copysign({s}, u)"),
}  # fmt: skip


def save_scale(
    chain: BellChain, output: str, temperature_column: str, sources: tuple[ModelSource, ...], made_by: str
) -> Model:
    """Return a fitted chain as a model that compensates the column `output`."""
    values, covariance = (chain.null, chain.scale), chain.rough_covariance
    rough = make_part("rough", ("null", "scale"), values, _units("rough", 2, output), covariance)
    curve = chain.scale_over_rate
    law: dict[str, Setting] = {FORM: curve.form, BLIND: curve.blind} if isinstance(curve, RateCurve) else {}
    law |= {WARMING: astuple(chain.warming)} if chain.warming else {}
    return Model(
        kind="scale",
        compensates=output,
        parts=(
            rough,
            _save_curve("bias", chain.bias),
            _save_curve("scale_over_rate", curve),
            _save_curve("scale_over_temperature", chain.scale_over_temperature),
        ),
        settings={
            "temperature_column": temperature_column,
            "sampling_s": chain.sampling,
            "fir_taps": tuple(float(tap) for tap in chain.taps),
            **law,
        },
        validity={
            temperature_column: widen(
                max(chain.bias.lowest, chain.scale_over_temperature.lowest),
                min(chain.bias.highest, chain.scale_over_temperature.highest),
            ),
            RATE: widen(curve.lowest, curve.highest),
        },
        sources=sources,
        made_by=made_by,
    )


def known(model: Model) -> Known:
    """Return the keys of a chain, and the units of its steps."""
    load_scale(model)
    form = str(model.settings.get(FORM, ""))
    units = {name: _units(name, len(model.part(name).values), model.compensates, form) for name in ("rough", *STEPS)}
    settings = ("temperature_column", "sampling_s", "fir_taps", FORM, BLIND, WARMING)
    return Known(settings, (model.temperature_column, RATE), units)


def _units(step: str, count: int, output: str = "", form: str = "") -> list[str]:
    """Units of the coefficients of one step of the chain."""
    raw = "counts" if output == "output_counts" else "deg/s"
    units = [raw, f"deg/s per {raw}"] if step == "rough" else list(STEPS[step])
    if form and step == "scale_over_rate":
        units = ["deg/s", "1", C_FORMS[form][0]]
    return [*units, *([f"{units[-1]} per power"] * (count - len(units)))][:count]


def load_scale(model: Model) -> BellChain:
    """Return the chain that a model file holds."""
    rough, column = model.part("rough"), model.temperature_column
    for name in ("null", "scale"):
        if name not in rough.names:
            raise InputError(f"{model.where} [[part]] rough: the coefficient '{name}' is missing.")
    if rough["scale"] == 0:
        raise InputError(f"{model.where}: [[part]] rough: scale is 0, so the output has no effect; correct it.")
    range_ = model.range_of(column)
    taps = model.settings.get("fir_taps", ())
    if isinstance(taps, str | float):
        raise InputError(f"{model.where} [settings]: fir_taps must be a list of numbers, [] for no filter.")
    warming = model.settings.get(WARMING, ())
    if not isinstance(warming, tuple) or (
        warming and not (len(warming) == 4 and abs(warming[2]) < 1 and warming[3] > 0)
    ):
        raise InputError(f"{model.where} [settings]: {WARMING} must be a, b, g and turn, |g| below 1 and turn above 0.")
    return BellChain(
        null=rough["null"],
        scale=rough["scale"],
        rough_covariance=np.array(rough.covariance) if rough.covariance else np.zeros((2, 2)),
        bias=_load_curve(model, "bias", range_),
        scale_over_rate=_load_curve(model, "scale_over_rate", model.range_of(RATE)),
        scale_over_temperature=_load_curve(model, "scale_over_temperature", range_),
        taps=np.array(taps, dtype=float),
        sampling=model.number("sampling_s", least=0),
        warming=Warming(*warming) if warming else None,
    )


def compensate(model: Model, record: Record, *, extrapolate: bool) -> dict[str, Array]:
    """Return the compensated rate; without a filter, rows that lack an input stay empty."""
    output, column = model.compensates, model.temperature_column
    model.check_inputs(record, column, outputs=RAW)
    complete = np.isfinite(record[output]) & np.isfinite(record[column])
    chain = load_scale(model)
    if len(chain.taps) and not np.all(complete):
        row = int(np.flatnonzero(~complete)[0])
        raise InputError(
            f"{output} or {column} is empty in row {row + 1} of the table, but the FIR filter needs every sample; fill the gap, or fit the chain without a filter (--no-filter)."
        )
    if np.count_nonzero(complete) < 2:
        raise InputError(f"no two rows have both {output} and {column}; nothing can be compensated.")
    judged = drop_spikes(complete, record[output], record[column])
    model.check_range(column, record[column][judged], extrapolate)
    compensated = np.full(len(record), np.nan)
    time, raw, temperature = (record[name][complete] for name in ("time_s", output, column))
    result = apply_chain(chain, time, raw, temperature, extrapolate=True)
    model.check_range(RATE, result.bias_compensated[judged[complete]], extrapolate)
    compensated[complete] = result.filtered
    return {f"{COMPENSATED}{RATE}": compensated}


def emit_c(model: Model) -> str:
    """Return `hrg_rate(output, T)`, the static steps, and `hrg_smooth(&state, rate)`, the filter, in C99."""
    rough = model.part("rough")
    taps = load_scale(model).taps
    smoother = ""
    if len(taps):
        values = ",\n    ".join(repr(float(tap)) for tap in taps)
        sampling = f"{model.number('sampling_s', least=0):g}"
        smoother = "\n" + write_c("smoother", count=len(taps), taps=values, sampling=sampling)
    if warming := load_scale(model).warming:
        shift = repr(warming.offset - warming.gain * warming.null)
        smoother += "\n" + write_c("warming", turn=repr(warming.turn), gain=repr(warming.gain), shift=shift)
    T = "temperature_degC"
    variables = {"bias": T, "scale_over_rate": "rate", "scale_over_temperature": T}
    curves = {name: polynomial(f"hrg_{name}", x, model.part(name).values) for name, x in variables.items()}
    if model.settings.get(FORM):
        curves["scale_over_rate"] = _emit_law(model)
    functions = "\n\n".join(curves.values())
    null, scale = repr(rough["null"]), repr(rough["scale"])
    code = write_c("scale", functions=functions, output=model.compensates, null=null, scale=scale, smoother=smoother)
    return f"{head(model)}\n{code}\n{self_test(_test_rows(model), 'output, temperature_degC, rate before any filter (NaN: not told)', STEP)}"


STEP = """    double found = hrg_rate(row[0], row[1]), expected = row[2];
    if (isnan(expected)) return !isnan(found);"""


def _test_rows(model: Model) -> list[tuple[float, ...]]:
    """Outputs over the fitted rates and temperatures, and what the steps make of them."""
    chain = replace(load_scale(model), taps=np.empty(0), warming=None)
    rate, T = (np.linspace(*model.range_of(name), 5) for name in (RATE, model.temperature_column))
    rate, T = (own.ravel() for own in np.meshgrid(rate, T))
    output = (rate + chain.bias.value(T)) / chain.scale + chain.null
    steady = apply_chain(chain, np.arange(float(rate.size)), output, T, extrapolate=True).temperature_compensated
    return list(zip(output.tolist(), T.tolist(), steady.tolist(), strict=True))


def _save_curve(name: str, curve: PolynomialCurve) -> ModelPart:
    form = curve.form if isinstance(curve, RateCurve) else ""
    names = ["a", "k", *FORMS[form].own] if form else [f"c{i}" for i in range(len(curve.coefficients))]
    return make_part(name, names, curve.coefficients, _units(name, len(names), form=form), curve.covariance)


def _load_curve(model: Model, name: str, limits: tuple[float, float]) -> PolynomialCurve:
    part, form = model.part(name), str(model.settings.get(FORM, "")) if name == "scale_over_rate" else ""
    if not form:
        model.check_names(part, "c")
    elif not (form in C_FORMS and part.names == ("a", "k", *FORMS[form].own) and part["k"] > 0):
        laws = "; ".join(f"{one}: a, k, {FORMS[one].own[0]}" for one in C_FORMS)
        raise InputError(f"{model.where}: {FORM} and the coefficients of {name} must be one of {laws}; k above 0.")
    covariance = np.array(part.covariance) if part.covariance else np.zeros((len(part.values),) * 2)
    found = np.array(part.values), covariance, *limits
    return RateCurve(*found, form, model.number(BLIND, least=0)) if form else PolynomialCurve(*found)


def _emit_law(model: Model) -> str:
    form, (a, k, s) = str(model.settings[FORM]), model.part("scale_over_rate").values
    t = (k / (3 * max(abs(s), 1e-30))) ** 0.5
    told = C_FORMS[form][-1].format(k=k, s=f"({s!r})", t=t, w=f"1.5 * u / {t!r}", blind=model.number(BLIND))
    return f"""/* Law over rate: {form}; NAN where the output does not tell the rate. */
static double hrg_scale_over_rate(double rate) {{
    double u = (rate - ({a!r})) / {k!r};
    return {told};
}}"""
