"""Terms of a decay: one mode or two, nonlinear rates and drift where they improve the fit, and lines that are interference."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from compensation.arrays import Array, Complex
from compensation.ringdown.envelope import Envelope
from compensation.ringdown.fit import CURVED, DecayFit, Guess, Terms, drift_shapes, fit_decay
from compensation.ringdown.model import swing
from compensation.ringdown.whiteness import Leftover, examine, find_line

PAYS = 20.0  # least fall of −2 ln L, over the widening², for a second mode or a tone, beside 2 ln N
NAMED, RARER = (1, 2), 1e-4
"""Numbers that a rate depending on the amplitude and a drift have: the fall that noise passes with the probability `RARER` is χ² of so many. A term that is not there costs six times the bound."""
WHITE, WANDERED = 1.3, 3.0
TONES, DEGREES, WANDERS = 3, 8, (16, 32, 64)
SMALL = 1e-4  # radians of the trial step of a curved rate
TAIL = 0.3  # last part of a window, in which a weak tone stands out of a decay


Rival = tuple[float, Terms, Guess]  # the fall of −2 ln L that the linearised fit promises, and where to start


@dataclass(frozen=True)
class Found:
    """A fit with the terms that pay, and what it leaves."""

    fit: DecayFit
    left: Leftover


def is_plain(left: Leftover) -> bool:
    """Whether a residual is white, from its first row on."""
    return not left.early and left.widening < WHITE


def describes(found: Found) -> bool:
    """Whether one decay describes a window: a plain residual, or what is left of a frequency that wanders."""
    wanders = found.fit.terms.drift > DEGREES and not found.left.early
    return is_plain(found.left) or (wanders and found.left.widening < WANDERED)


def fit_terms(envelope: Envelope, known: tuple[Terms, Guess] | None = None, most: int = 12) -> Found:
    """Fit one mode or two, then add up to `most` terms beyond the linear decay while they pay, and drop those that no longer do."""
    if known is None:
        one, two = fit_decay(envelope, Terms(1)), fit_decay(envelope, Terms(2))
        fit = _extend(envelope, two if one.cost - two.cost > _second(envelope) else one, most)
        if not fit.one_mode:  # a frequency or damping that goes with the amplitude looks like a second mode
            bent = _add(envelope, one, False, len(CURVED))
            dearer = bent.cost + _price(one, bent.terms) - fit.cost - _price(two, fit.terms)
            if dearer < _second(envelope) and is_plain(examine(bent.residual)):
                fit = _extend(envelope, bent, most)
    else:
        fit = _drop(envelope, _add(envelope, fit_decay(envelope, known[0], [known[1]]), False, most))
    left = examine(fit.residual)
    if not fit.one_mode:
        one = fit_decay(envelope, replace(fit.terms, modes=1), [replace(fit.found, start=None)])
        if np.any(fit.decay.rates.real > 0) or one.cost - fit.cost < _second(envelope) * left.widening**2:
            fit = _extend(envelope, one, most)
            left = examine(fit.residual)
    return Found(fit, left)


def _second(envelope: Envelope) -> float:
    """Return what a second mode must save: noise offers as many places for it as there are rows; each costs the odds."""
    return PAYS + 2 * float(np.log(envelope.time.size))


def _price(fit: DecayFit, terms: Terms) -> float:
    """Return what terms must save beyond those of a fit."""
    tones = terms.tones - fit.terms.tones
    more = np.array([len(terms.curved) - len(fit.terms.curved), (terms.drift - fit.terms.drift + 1) // 2])
    return float(scipy.special.chdtri(NAMED, RARER) @ more) + tones * (PAYS + 2 * float(np.log(fit.envelope.time.size)))


def _extend(envelope: Envelope, fit: DecayFit, most: int) -> DecayFit:
    """Add amplitude and drift first, or tones first where that takes tones or leaves something; then drop what does not pay."""
    ways = [_add(envelope, fit, False, most)]
    if ways[0].terms.tones or not is_plain(examine(ways[0].residual)):
        ways.append(_add(envelope, fit, True, most))
    ways = [_drop(envelope, one) if is_plain(examine(one.residual)) else one for one in ways]
    return min(ways, key=lambda one: one.cost + _price(fit, one.terms))


def _add(envelope: Envelope, fit: DecayFit, tones_first: bool, most: int) -> DecayFit:
    """Add terms, by the fall that the linearised fit promises of each, while they pay."""
    sure = fit  # the last whose price is paid for a residual that is not white, too
    for _ in range(most):
        rivals = [one for one in _rivals(envelope, fit) if one[0] > 0.5 * _price(fit, one[1])]
        rivals.sort(key=lambda one: ((one[1].tones > fit.terms.tones) != tones_first, _price(fit, one[1]) - one[0]))
        paid = [(fit, fit.cost)]
        for _, terms, guess in _tried(fit, rivals):
            tried = fit_decay(envelope, terms, [guess])
            paid.append((tried, tried.cost + _price(fit, terms)))
        best = min(paid, key=lambda one: one[1])[0]
        if best is fit:
            break
        widening = examine(best.residual).widening
        sure = best if sure.cost - best.cost > _price(sure, best.terms) * widening**2 else sure
        fit = best
    return sure


def _tried(fit: DecayFit, rivals: list[Rival]) -> list[Rival]:
    """Return the two rivals that promise most and the best curved one, whose promise is of first order only; none beside a frequency that wanders."""
    wanders = fit.terms.drift > DEGREES
    curved = [k for k, one in enumerate(rivals) if len(one[1].curved) > len(fit.terms.curved)]
    first = [k for k in range(len(rivals)) if not (wanders and k in curved)][:2]
    return [rivals[k] for k in sorted({*first, *([] if wanders else curved[:1])})]


def _drop(envelope: Envelope, fit: DecayFit) -> DecayFit:
    """Leave out a term without which nothing is lost: a drift that stood for a cubic stiffness, or the other way round."""
    terms, found = fit.terms, fit.found
    poorer = [
        (replace(terms, curved=tuple(one for one in terms.curved if one != name)), found) for name in terms.curved
    ]
    poorer += [(replace(terms, drift=0), replace(found, drift=()))] if 0 < terms.drift <= DEGREES else []
    for k in range(terms.tones):
        tones, sizes = ((*each[:k], *each[k + 1 :]) for each in (found.tones, found.sizes))
        poorer.append((replace(terms, tones=terms.tones - 1), replace(found, tones=tones, sizes=sizes)))
    for less, guess in poorer if len(poorer) > 1 else []:
        tried = fit_decay(envelope, less, [guess])
        if tried.cost - fit.cost < _price(tried, terms):
            return _drop(envelope, tried)
    return fit


def _rivals(envelope: Envelope, fit: DecayFit) -> Iterator[Rival]:
    """Yield every term that may be added."""
    time = envelope.time - envelope.time[0]
    noise = fit.noise[:, None]
    r = fit.residual / noise
    unit = SMALL / float(np.sum(np.abs(fit.start) ** 2) * time[-1])
    more = [replace(fit.decay, **{name: getattr(fit.decay, name) + unit}) for name in CURVED]
    swung = swing([fit.decay, *more], time, np.array([fit.start] * 3))
    phase = np.exp(1j * (np.array(fit.found.drift) @ drift_shapes(envelope, fit.terms.drift)))
    z, *curved = (swung.sum(axis=1, keepdims=True) if fit.summed else swung) * phase / noise
    Q = np.linalg.qr(fit.jacobian)[0]

    def promise(*columns: Complex) -> tuple[float, Array]:
        D = np.stack([np.concatenate([one.real.ravel(), one.imag.ravel()]) for one in columns], axis=1)
        if not np.all(np.isfinite(D)):
            return 0.0, np.zeros(D.shape[1])
        free = D - Q @ (Q.T @ D)
        flat = np.concatenate([r.real.ravel(), r.imag.ravel()])
        step = np.linalg.lstsq(free, flat, rcond=None)[0]
        return 2 * float(flat @ free @ step), step

    terms, found = fit.terms, fit.found
    for name, column in zip(CURVED, curved, strict=True):
        if name not in terms.curved:
            gain, step = promise((column - z) / unit)
            yield (
                gain,
                replace(terms, curved=(*terms.curved, name)),
                replace(found, decay=replace(found.decay, **{name: float(step[0])})),
            )
    if terms.drift < DEGREES:
        shapes = drift_shapes(envelope, terms.drift + 2)[-2:]
        gain, step = promise(*(1j * shape * z for shape in shapes))
        yield gain, replace(terms, drift=terms.drift + 2), replace(found, drift=(*found.drift, *step.tolist()))
    # a course of any kind: the phase that the data are ahead of the model, in both channels alike
    shared = np.sum((r + z) * z.conj(), axis=0)
    ahead, size = np.unwrap(np.angle(shared)), np.sqrt(np.abs(shared))
    wide = WANDERS if np.all(np.isfinite(shared)) and not terms.tones else ()  # a mode that grows may leave the numbers
    for degrees in (one for one in wide if terms.drift < one < time.size / 4):
        columns = np.vstack([np.ones_like(time), time, drift_shapes(envelope, degrees)])
        level, slope, *more = np.linalg.lstsq((columns * size).T, ahead * size, rcond=None)[0].tolist()
        left = r + z - z * np.exp(1j * (np.array([level, slope, *more]) @ columns))
        gain = (
            2 * time.size * float(np.sum(np.log(np.mean(np.abs(r) ** 2, axis=1) / np.mean(np.abs(left) ** 2, axis=1))))
        )
        decay = replace(found.decay, detuning=found.decay.detuning + slope)
        drift = (np.resize([*found.drift, *np.zeros(degrees)], degrees) + more).tolist()
        start = fit.start * np.exp(1j * level)
        yield gain, replace(terms, drift=degrees), replace(found, decay=decay, start=start, drift=tuple(drift))
    if terms.tones < TONES and terms.drift <= DEGREES:  # no line can be told from a frequency that wanders
        late = time > (1 - TAIL) * time[-1]
        lines = {find_line(envelope.time, fit.residual), find_line(envelope.time[late], envelope.values[:, late])}
        for line in lines - {None}:
            tone = 2 * np.pi * float(line or 0.0)
            wave = np.exp(1j * tone * time)
            units = [np.eye(len(noise))[:, c : c + 1] / noise * wave for c in range(len(noise))]
            gain, step = promise(*units, *(1j * one for one in units))
            size = tuple((step[: len(noise)] + 1j * step[len(noise) :]).tolist())
            yield (
                gain,
                replace(terms, tones=terms.tones + 1),
                replace(found, tones=(*found.tones, tone), sizes=(*found.sizes, size)),
            )
