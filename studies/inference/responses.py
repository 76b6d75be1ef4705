"""Verdict of each response: what is left of it, what slow noise may hide, and the words beside it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from compensation.noise import Noise, white_rms
from studies.calibration.noise_levels import LASTING, stated_noise
from studies.diagnosis.constants import CONSTANTS
from studies.diagnosis.response import RESPONSES
from studies.diagnosis.verdict import Cause, ResponseResult, gain_of
from studies.inference.causes import SURE_DELAY, by_rows, delay_of, farthest
from studies.inference.inferred import Inferred
from studies.inference.lack_of_fit import LAST_DIGIT, doubt_of

FEWEST_LAGS = 3.0
"""Time constants that the records must cover before they confirm a law whose lag is free."""
BRIEF, MINUTES = 300.0, 5.0
"""Seconds, and times the change within them up to which slow noise is usual where no card states it: a random walk of a day."""
SLOW_THAN = {True: "what the card states of its noise", False: "what noise usually makes of its changes within minutes"}
LEAST_DELAY = 0.5
"""Part of what sensors and clocks usually have, from which on a delay is said."""
ODD = 5.0
"""Times the scatter of the other runs from which on one is odd."""
ROUNDED = "what is left of it is the last digit of its readings; less than a digit of structure would not show"
NARROW_RANGE = 1.0
"""Kelvin below which a temperature does not vary."""


def result_of(found: Inferred, name: str, causes: Sequence[Cause]) -> ResponseResult:
    """Return what was found about one response beside the causes that are named."""
    left, plain, rows = found.left[name], found.plain[name], found.rows[name]
    before, after = found.held_out[name]
    terms = any(term.response == name for term in found.final.terms) or (
        found.path is not None and name == found.search.linear.responses[0]
    )
    if not terms and (found.path is not None or any(term.effect.thermal for term in found.final.terms)):
        plain, before = rows, after  # without a cause of its own it follows the temperature that was found
    mine = [cause for cause in causes if cause.response == name and cause.kind == "physics"]
    values = any(cause.is_wrong_value and cause.response == name for cause in causes)
    share = (left.share if left.significant else 1.0) if terms else None
    slow = _slow(found, name)
    verdict, remark = _judge(found, name, terms, mine, values, slow, share)
    coarse = ROUNDED if left.input == LAST_DIGIT else ""
    remarks = (remark, coarse, _delayed(found, name), _correlated(found, name), _turned_on(found, name, verdict))
    remark = "; ".join(filter(None, remarks))
    noise = min(value for value in (rows.rms, after if terms else before) if value is not None)
    white = white_rms(*rows.residual)
    return ResponseResult(
        verdict,
        noise,
        (plain.rms, before),
        (rows.rms, after) if terms else None,
        "structure" if left.significant else "none",
        left.input if left.doubtful else "",
        2.0 * max(left.evidence, 0.0),
        share,
        remark,
        white=white,
        wander=float(np.sqrt(max(rows.rms**2 - white**2, 0.0))),
        shipped=found.shipped[name],
        run_shifts=_run_shifts(found, name),
    )


def _judge(
    found: Inferred, name: str, terms: bool, mine: Sequence[Cause], values: bool, slow: float, share: float | None
) -> tuple[str, str]:
    left, apart = found.left[name], _apart(found, name)
    clean = share is None or share >= CONSTANTS["share_explained"]
    patched = bool(mine) and max(cause.probability for cause in mine) < CONSTANTS["believed"]  # rather wrong than right
    if left.significant and (share is None or not clean or patched):
        return "unexplained", apart
    if apart and not terms and not mine and found.card.polynomial is not None:
        return "not-identifiable", apart
    if slow > CONSTANTS["wander_usual"]:
        return "not-identifiable", (
            f"the slow part of the residual is {slow:.2g} times {SLOW_THAN[_stated(found, name) is not None]}: these records cannot"
            " distinguish slow noise from a cause that acts slowly"
        ) + (apart and f"; {apart}")
    if mine and left.doubtful and (gain_of(*found.held_out[name]) or 1.0) < CONSTANTS["patching"]:  # a patch
        return "not-identifiable", doubt_of(left.input, left.evidence)
    if terms or mine:
        return ("not-identifiable" if patched or any(cause.equivalent for cause in mine) else "explained"), apart
    if values:
        return "explained", apart
    paths = found.search.signatures.paths
    if found.card.polynomial is not None:
        lasts = sum(float(np.ptp(path.time)) for path in paths)
        lag = max(path.states.tau for path in paths)
        if lasts < FEWEST_LAGS * lag:
            return (
                "not-identifiable",
                f"too short to judge: {lasts:.0f} s, and the resonator may follow the housing with {lag:.0f} s or more",
            )
    resonator = np.concatenate([path.states.resonator for path in found.search.signatures.paths])
    if np.ptp(resonator) < NARROW_RANGE:
        remark = f"the resonator's temperature changes by {np.ptp(resonator):.2g} K only: what follows it cannot show"
    else:
        remark = apart
    return ("not-identifiable", doubt_of(left.input, left.evidence)) if left.doubtful else ("adequate", remark)


def _delayed(found: Inferred, name: str) -> str:
    """Return the sentence on a delay that a polynomial law has taken: it tolerates what sensors and clocks may have."""
    z, sd, usual = delay_of(found)
    if name != found.search.linear.responses[0] or abs(z) < max(SURE_DELAY * sd, LEAST_DELAY):
        return ""
    delay = by_rows(z, sd)[0] * usual
    return (
        f"it follows the temperature {abs(delay):.2g} s {'later' if delay > 0.0 else 'earlier'} than"
        f" {'one lag predicts' if found.path is None else 'its lags predict'}, as sensors and clocks may; a thermometer lag or a rate effect of this size looks the same"
    )


def _correlated(found: Inferred, name: str) -> str:
    """Return the sentence on noise with a correlation time of its own that no card states."""
    noise, response, stated = found.final.noise[name], RESPONSES[name], _stated(found, name)
    if not noise.markov or (stated is not None and stated.markov):
        return ""
    return (
        f"its noise is like correlated (Gauss–Markov) noise of {noise.markov * response.scale:.2g} {response.shown} (rms) and"
        f" {noise.markov_time:.2g} s; what no recorded input tells of may look the same"
    )


def _turned_on(found: Inferred, name: str, verdict: str) -> str:
    """Return the sentence on offsets of runs far beyond what is left within them."""
    if name in LASTING or verdict != "adequate":
        return ""
    if odd := _odd_run(found, name):
        return f"{odd}: one turn-on, or something done between the runs"
    apart, within = _apart_and_within(found, name)
    response = RESPONSES[name]
    if apart <= CONSTANTS["wander_usual"] * within or found.card.polynomial is None:
        return ""
    return (
        f"the runs lie {apart * response.scale:.3g} {response.shown} (rms) apart, which is treated as a turn-on offset; ageing or a jump"
        " between runs would look the same. A saved model states it as turn-on; a card with bias_turn_on_deg_per_h distinguishes them"
    )


def _apart(found: Inferred, name: str) -> str:
    """Return the sentence on runs of a response without turn-on that lie farther apart than what is left within them."""
    apart, within = _apart_and_within(found, name)
    if name not in LASTING or apart <= CONSTANTS["wander_usual"] * within:
        return ""
    if odd := _odd_run(found, name):
        return f"{odd}: another gyro, or something done between the runs"
    response = RESPONSES[name]
    text = (
        f"the runs lie {apart * response.scale:.3g} {response.shown} (rms) apart, {apart / within:.0f} times the residual within them:"
        " ageing, clock error, handling, or drift between runs"
    )
    return text if found.campaign.timed else text + "; start times ('# start' in the records) would show which of these"


def _odd_run(found: Inferred, name: str) -> str:
    """Name a run whose level lies far from those of the others, which agree; or nothing."""
    shifts, response = np.array(_run_shifts(found, name)), RESPONSES[name]
    if len(shifts) < 3:
        return ""
    far, odd = farthest(shifts)
    scatter = float(np.std(np.delete(shifts, far), ddof=1))
    if abs(odd) <= ODD * max(scatter, found.rows[name].within):
        return ""
    record = found.campaign.records[far].path or f"run {far + 1}"
    return (
        f"{record}: its {response.word} lies {odd * response.scale:+.3g} {response.shown} from that of the other runs, which agree to"
        f" {scatter * response.scale:.2g} {response.shown}"
    )


def _apart_and_within(found: Inferred, name: str) -> tuple[float, float]:
    """How far the runs lie apart (rms), and what is left within them."""
    return float(np.sqrt(np.mean(np.square(_run_shifts(found, name))))), found.rows[name].within


def _slow(found: Inferred, name: str) -> float:
    """What is left of a response over the scatter of neighbouring rows and what the card states of slow noise."""
    rows, stated, level = found.rows[name], _stated(found, name), found.search.linear.rows[name]
    if stated is None:  # over the changes within minutes
        rest = found.background.residual(name)
        apart = max(1, round(BRIEF / level.span))
        changes = np.concatenate([rest[own][apart:] - rest[own][:-apart] for own in level.slices])
        change = float(np.mean(changes**2)) if len(changes) else 0.0
        brief = float(np.hypot(white_rms(*rows.residual), np.sqrt(change / 2.0)))
        return rows.rms / max(MINUTES * brief, 1e-300)
    slow = level.variances(replace(stated, offset=0.0))  # a walk moves the level of a run too
    usual = np.average(slow, weights=np.concatenate(level.spans)) + white_rms(*rows.residual) ** 2
    return rows.rms / max(float(np.sqrt(usual)), 1e-300)


def _stated(found: Inferred, name: str) -> Noise | None:
    """Slow noise of a response that a card states."""
    return stated_noise(found.card.noise, name) if found.card.polynomial is None else None


def is_slow(found: Inferred, name: str) -> bool:
    """Whether more slow noise is left of a response than is usual."""
    return _slow(found, name) > CONSTANTS["wander_usual"]


def _run_shifts(found: Inferred, name: str) -> tuple[float, ...]:
    """Mean of what is left of each run, about their mean."""
    level = found.search.linear.rows[name]
    rest = found.background.residual(name)
    means = np.array([rest[own].mean() for own in level.slices])
    return tuple(float(value) for value in means - means.mean())
