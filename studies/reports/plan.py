"""Parts of a plan: which effects a campaign can identify, how small they may be, and what would be named instead."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.planning.plan import Outlook, Plan, effect_of, response_of
from studies.diagnosis.planning.rehearsal import NOTHING
from studies.diagnosis.response import RESPONSES
from studies.reports.style import figure
from studies.results import Chapter, Column, Drawing, Facts, Figure, Sentence, Table

SEEN = 0.02
"""Share below which an answer is not listed."""
SNR_WORDS = (
    "SNR: rms of the part of the effect that the refitted simulation cannot absorb, over the rms noise of one row of the record."
    " With many rows an effect far below the noise of one row can be identified."
)
NOISE = {"slow": "coloured"}
SENSORS = (Column("sensor", "sensor"), Column("count", "sets"), Column("pairs", "effects distinguished"))


def headline(outlook: Outlook) -> str:
    """Return what the campaign can identify, in a few sentences."""
    effects = list(outlook.close.confusion)
    parts = [f"{_sure(outlook, plan)} of {len(effects)} at SNR {plan.snr:g}" for plan in outlook.plans]
    first = outlook.plans[0]
    text = f"Effects identified in at least 90 % of cases: {', '.join(parts)}."
    if first.sizes:
        text += f" SNR {first.snr:g} is {_sizes(first)}."
    never = [key for key in effects if outlook.smallest(key) is None]
    if never:
        text += f" Not even at SNR {outlook.plans[0].snr:g}: {', '.join(map(shown_key, never))}."
    for reason in dict.fromkeys(outlook.close.invisible.values()):
        names = [name for name, why in outlook.close.invisible.items() if why == reason]
        text += f" Not testable ({reason}): {', '.join(names)}."
    return text


def plan_table(outlook: Outlook) -> Table:
    """Return the prediction as a table, the effects that are easiest to identify first."""
    close = outlook.close
    rows = [
        {
            "effect": shown_key(key),
            "named": [_named(plan, key) for plan in outlook.plans],
            "set": _listed(close.sets[key], ()),
            "instead": _listed(close.confusion[key], (effect_of(key),)),
            "survives": close.survives[key],
        }
        for key in _ranked(outlook)
    ]
    nothing = {"named": [0.0] * len(outlook.plans), "survives": 0.0}
    rows += [{"effect": name, "instead": why, **nothing} for name, why in close.invisible.items()]
    columns = [
        Column("effect", "hidden effect"),
        *(Column(f"named.{k}", f"identified at SNR {plan.snr:g}", "%", ".0f", scale=100.0) for k, plan in enumerate(outlook.plans)),
        Column("set", f"as a set with (SNR {close.snr:g})"),
        Column("instead", f"named instead (SNR {close.snr:g})"),
        Column("survives", "not absorbed by the baseline", "%", ".0f", scale=100.0),
    ]  # fmt: skip
    note = "Identified: the answer is the effect, or a set that contains it. " + SNR_WORDS
    return Table(f"Effects that this campaign can identify, {close.cases} cases each", rows, columns, note)


def shown_key(key: str) -> str:
    """Return the name of a hidden effect, with the response that it is hidden in for people: "jump (bias)"."""
    key = key if " (" in key else f"{key} ({response_of(key)})"
    for column, response in RESPONSES.items():
        key = key.replace(f"({column})", f"({response.word})")
    return key


def _ranked(outlook: Outlook) -> list[str]:
    return sorted(outlook.close.confusion, key=lambda key: [-_named(plan, key) for plan in reversed(outlook.plans)])


def _sure(outlook: Outlook, plan: Plan) -> int:
    return sum((least := outlook.smallest(key)) is not None and least <= plan.snr for key in outlook.close.confusion)


def _named(plan: Plan, key: str) -> float:
    return plan.outcome(key)["named"] if key in plan.confusion else 0.0


def _listed(shares: dict[str, float], but: tuple[str, ...]) -> str:
    words = (f"{name} {100 * share:.0f} %" for name, share in shares.items() if name not in but and share >= SEEN)
    return ", ".join(words)


def _sizes(plan: Plan) -> str:
    return ", ".join(f"{value:.2g} {key.split(' / ')[1]}" for key, value in plan.sizes.items()) + " rms"


def plan_parts(outlook: Outlook, profiles: Sequence[str]) -> list[Chapter]:
    """Return what people read of a plan."""
    close = outlook.close
    total = len(close.confusion)
    facts = [
        (f"Identified at SNR {plan.snr:g}", f"{_sure(outlook, plan)} of {total}", f"in at least 90 % of cases; {_sizes(plan)}")
        for plan in outlook.plans
    ]  # fmt: skip
    facts.append(("Chamber time", f"{close.hours:.3g} h", "of all planned runs"))
    facts.append(("Not testable", str(len(close.invisible)), "the plan does not excite these effects"))
    runs = [{"run": k + 1, "chamber": words} for k, words in enumerate(profiles)]
    sensors = [
        {"sensor": name, "count": len(pairs), "pairs": ", ".join(pairs)} for name, pairs in close.sensors.items()
    ]
    shares = "How often each effect is identified (%), in white noise and with coloured noise added."
    confusion = (
        f"Rows: hidden effect; columns: answer; % of {close.cases} cases at SNR {close.snr:g}. Nothing: not detected."
    )
    method = (
        "A gyro without effects goes through the planned runs with nominal physics. Each effect is added"
        f" {close.cases} times at each SNR, with random shapes, in white noise and, in every second case, also in coloured noise."
        " The answers follow the rules of the diagnosis."
    )
    note = f"Sets at SNR {close.snr:g}. A sensor costs no chamber time; the most useful is listed first."
    return [
        Chapter("In short", [
            Sentence(headline(outlook), where="terminal"),
            Facts(facts, "page"),
            Table("Planned runs", runs, (Column("run", "run"), Column("chamber", "chamber")), where="page"),
            Figure(lambda: _draw_shares(outlook), shares),
        ]),
        Chapter("All effects", [
            plan_table(outlook),
            Table("Sensors that distinguish effects without a further run", sensors, SENSORS, note, "page"),
        ]),
        Chapter("What would be named", [Figure(lambda: _draw_confusion(close), confusion)]),
        Chapter("Method", [Sentence(method, where="page")]),
    ]  # fmt: skip


def _draw_shares(outlook: Outlook) -> Drawing:
    """How often each effect is named at each SNR, under white and with slow noise."""
    keys = _ranked(outlook)
    columns = [(plan, noise) for plan in outlook.plans for noise in plan.by_noise]
    shares = [[plan.by_noise[noise].get(key, {}).get(effect_of(key), 0.0) for plan, noise in columns] for key in keys]
    return _map(shares, keys, [f"SNR {plan.snr:g}\n{NOISE.get(noise, noise)} noise" for plan, noise in columns])


def _draw_confusion(plan: Plan) -> Drawing:
    keys = sorted(plan.confusion)
    said = {name for shares in plan.confusion.values() for name in shares} | {effect_of(key) for key in keys}
    names = [*sorted(said - {NOTHING}), NOTHING]
    return _map([[plan.confusion[key].get(name, 0.0) for name in names] for key in keys], keys, names, 55.0)


def _map(table: list[list[float]], keys: list[str], columns: Sequence[str], turn: float = 0.0) -> Drawing:
    shares = np.array(table)
    with figure(height=0.25 * len(keys) + (1.8 if turn else 0.8)) as (made, axes):
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        axes.grid(False)
        side = {"ha": "right", "rotation_mode": "anchor"} if turn else {"ha": "center"}
        axes.set_xticks(range(len(columns)), columns, rotation=turn, fontsize=8, **side)
        axes.set_yticks(range(len(keys)), list(map(shown_key, keys)), fontsize=8)
        for i, j in zip(*np.nonzero(np.round(100 * shares)), strict=True):
            colour = "w" if shares[i, j] > 0.55 else "k"
            axes.text(j, i, f"{100 * shares[i, j]:.0f}", ha="center", va="center", fontsize=7, color=colour)
        return made
