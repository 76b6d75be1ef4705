"""From an inference to the verdict of the contract: causes, values that moved, each response, and what to measure next."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from compensation.constants import NINETY
from compensation.lines import Line
from studies.calibration.estimates import SILENT, over_the_wave
from studies.calibration.priors import from_standard, to_standard
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import (
    FAR,
    Cause,
    ResponseResult,
    Shift,
    Verdict,
    doubted,
    overall,
    spell_structure,
    wrong_values,
)
from studies.effects import find_effect
from studies.inference.background import Background
from studies.inference.causes import candidates_of, causes_of
from studies.inference.heat_path import FREQUENCY, MASS
from studies.inference.inferred import Inferred
from studies.inference.records import Campaign
from studies.inference.responses import is_slow, result_of
from studies.inference.sharp import longest_resolved


def judge(found: Inferred) -> Verdict:
    """Return the verdict."""
    shifts = shifts_of(found.background) if found.card.polynomial is None else []
    if found.path is not None:  # no card said anything of its mass
        shifts = [one for one in shifts if one.parameter not in MASS]
    causes = doubted(sorted((*wrong_values(shifts), *causes_of(found)), key=lambda cause: -cause.evidence))
    results = {name: result_of(found, name, causes) for name in found.search.linear.responses}
    results |= skipped_results(found.campaign)
    doubtful = _patching(found, causes, results)
    named = tuple(one for one in doubtful if one.kind == "value" or one.probability >= CONSTANTS["member"])
    told = {cause.response for cause in named}
    for name in found.search.linear.responses:
        if results[name].verdict == "not-identifiable" and name not in told:
            candidates = candidates_of(found, name)
            named += tuple(one for one in candidates if one.evidence > 0.0)
            if not candidates and found.card.polynomial is None and is_slow(found, name):
                results[name] = replace(results[name], verdict="unexplained")  # nothing known is slow in this way
    return Verdict(
        overall([result.verdict for result in results.values()]),
        named,
        results,
        next_step(named, results, {name: left.line for name, left in found.left.items()}),
        found.campaign.notes,
        calibration=tuple(shifts),
    )


def _patching(found: Inferred, causes: Sequence[Cause], results: Mapping[str, ResponseResult]) -> Iterator[Cause]:
    """Yield the causes, as doubtful as such names were where a response stays unexplained and is hardly predicted better, or where one run lies apart."""
    for cause in causes:
        own = results.get(cause.response)
        patches = own is not None and own.verdict == "unexplained" and (own.gain or 0.0) < CONSTANTS["patching"]
        patches |= found.campaign.one_apart and cause.response == FREQUENCY
        patches &= cause.kind == "physics"
        yield replace(cause, probability=cause.probability * (1.0 - CONSTANTS["doubt_unexplained"] * patches))


def skipped_results(campaign: Campaign) -> dict[str, ResponseResult]:
    """Return the results of responses that are not judged, with the reason."""
    return {
        name: ResponseResult("not-identifiable", None, (None, None), None, "none", remark=why)
        for name, why in campaign.skipped.items()
    }


def shifts_of(model: Background) -> list[Shift]:
    """Return the values of the card that the data determine or have moved, with 90 % intervals."""
    priors, posterior = model.linear.problem.priors, model.posterior
    polar, best, _, C = over_the_wave(priors, *posterior)
    at, out = priors.at(best), []
    for k, (value, z, sd) in enumerate(
        zip(priors.values, priors.standard(best), np.sqrt(np.diag(priors.covariance(C))), strict=True)
    ):
        low, high = (from_standard(value, z + side * NINETY * sd) for side in (-1.0, 1.0))
        if k in polar:
            low, high, sd, z = polar[k].low, polar[k].high, polar[k].width, to_standard(value, polar[k].value)
        if sd < SILENT or abs(z) > FAR:
            low, high = max(min(low, high), value.low), min(max(low, high), value.high)
            out.append(Shift(value.name, value.value, at[value.name], low, high, float(z)))
    return out


def next_step(
    causes: Sequence[Cause], results: Mapping[str, ResponseResult], lines: Mapping[str, Line | None]
) -> str | None:
    """Return what to measure next: what would separate a set, or see again what nobody explains."""
    for cause in causes:
        if cause.equivalent:
            sensors = sorted({find_effect(name).sensor for name in cause.names} - {""})
            more = f" Alternatively, without a run: {'; or '.join(sensors)}." if sensors else ""
            others = ", ".join(cause.equivalent)
            return f"To distinguish {cause.effect} from {others}: {find_effect(cause.effect).isolate}.{more}"
    for name, result in results.items():
        doubtful = result.verdict == "not-identifiable" and bool(result.left_over_input)
        if result.verdict == "unexplained" or doubtful:
            word, line = RESPONSES[name].word, lines.get(name)
            if line is not None:
                return (
                    f"The {word} has a line of {line.period:.3g} s: diagnose a part of at most {longest_resolved(line.period) / 3600:.2g} h,"
                    " where it is resolved, or record its spectrum."
                )
            by_time = result.left_over_input.startswith("time")
            has = ("has", "may have")[doubtful]
            return f"The {word} {has} {spell_structure(result.left_over_input)} that no known effect explains: " + (
                "hold temperature and drives constant for a run; what goes on there is not due to them."
                if by_time
                else "repeat a run unchanged to see whether it recurs, then vary that input alone."
            )
    return None
