"""Terms of a decay: one mode or two, nonlinear rates where they improve the fit, and lines that are interference."""

from dataclasses import replace

import numpy as np

from compensation.ringdown.envelope import Envelope
from compensation.ringdown.fit import DecayFit, fit_decay
from compensation.ringdown.whiteness import Leftover, examine

PAYS = 20.0  # least fall of −2 ln L, over the widening², for a second mode, beside 2 ln N
NAMED = 10.0
"""The same for a rate beyond the linear ones: noise passes it once in 200 records, and left out it shifts what is stated by up to √10 of its errors, and more."""
WHITE = 1.3
LINES = 3
BEYOND = ("hardening", "thickening", "chirp")


def fit_terms(envelope: Envelope) -> tuple[DecayFit, tuple[str, ...], list[float]]:
    """Fit one mode or two, the rates beyond the linear ones that pay, and lines that are no decay."""
    lines: list[float] = []
    data = envelope
    fit = fit_modes(data)
    left = examine(data.time, fit.residual)
    beyond: tuple[str, ...] = ()
    while True:
        fit, left, beyond = extend(data, fit, left, beyond)
        if left.line is None or len(lines) == LINES:
            break
        lines.append(left.line)
        data, fit = _without_lines(envelope, fit, lines, beyond)
        left = examine(data.time, fit.residual)
    return replace(fit, envelope=envelope), beyond, lines


def extend(
    envelope: Envelope, fit: DecayFit, left: Leftover, beyond: tuple[str, ...]
) -> tuple[DecayFit, Leftover, tuple[str, ...]]:
    """Add rates beyond the linear ones, the best first, while they pay."""
    modes = 1 if fit.one_mode else 2
    while len(beyond) < len(BEYOND):
        rivals = {
            name: fit_decay(envelope, extra=(*beyond, name), modes=modes, starts=[fit.decay])
            for name in BEYOND
            if name not in beyond
        }
        name = min(rivals, key=lambda one: rivals[one].cost)
        after = examine(envelope.time, rivals[name].residual)
        if not fit.cost - rivals[name].cost > NAMED * after.widening**2:
            break
        fit, left, beyond = rivals[name], after, (*beyond, name)
    return fit, left, beyond


def fit_modes(envelope: Envelope) -> DecayFit:
    """Fit two modes where the second pays: one that is not excited, or not split, cannot be told from the first.

    Noise offers as many places for a second mode as there are rows; each costs the odds.
    """
    one = fit_decay(envelope, modes=1)
    two = fit_decay(envelope, modes=2)
    left = examine(envelope.time, two.residual)
    price = (PAYS + 2 * np.log(envelope.time.size)) * left.widening**2
    return two if one.cost - two.cost > price and np.all(two.decay.rates.real < 0) else one


def _without_lines(
    envelope: Envelope, fit: DecayFit, lines: list[float], beyond: tuple[str, ...]
) -> tuple[Envelope, DecayFit]:
    """Take lines of constant amplitude out of the data, in turn with the decay."""
    data = envelope
    for _ in range(3):
        left = envelope.values - (data.values - fit.residual)
        step = 1 / (envelope.time[-1] - envelope.time[0])
        tones = np.zeros_like(left)
        for k, line in enumerate(lines):
            near = line + step * np.linspace(-1, 1, 81)
            basis = np.exp(2j * np.pi * np.outer(near, envelope.time))
            power = np.sum(np.abs((left - tones) @ basis.conj().T) ** 2, axis=0)
            lines[k] = float(near[int(np.argmax(power))])
            tone = np.exp(2j * np.pi * lines[k] * envelope.time)
            tones += np.outer(np.mean((left - tones) * tone.conj(), axis=1), tone)
        data = replace(envelope, values=envelope.values - tones)
        fit = fit_decay(data, extra=beyond, modes=1 if fit.one_mode else 2, starts=[fit.decay])
    return data, fit


def is_plain(left: Leftover) -> bool:
    """Return whether a residual is white, from its first row on."""
    return not left.early and left.widening < WHITE


def examine_without_lines(envelope: Envelope, fit: DecayFit) -> Leftover:
    """Examine a residual less its largest lines: interference is no reason to shorten the window."""
    residual = fit.residual
    for _ in range(LINES):
        left = examine(envelope.time, residual)
        if left.line is None:
            break
        tone = np.exp(2j * np.pi * left.line * envelope.time)
        residual = residual - np.outer(np.mean(residual * tone.conj(), axis=1), tone)
    return examine(envelope.time, residual)
