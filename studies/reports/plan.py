"""What a planned campaign could tell apart: two sentences, a table, and a page."""

from collections.abc import Sequence

import numpy as np

from studies.diagnosis.planning.plan import Outlook, Plan, effect_of
from studies.diagnosis.planning.rehearsal import NOTHING
from studies.diagnosis.response import RESPONSES
from studies.reports.page import Chapter, Facts, Picture, Table, Text, draw, render_page
from studies.reports.style import figure

SEEN = 0.02
"""Share below which an answer is not listed."""
SNR_WORDS = (
    "SNR: rms of what the refitted simulation cannot absorb of the effect, over the rms of the noise of one row of the record; "
    "many rows make an effect visible that is far below the noise of one."
)


def headline(outlook: Outlook) -> str:
    """Return what the campaign is good for, in a few sentences."""
    effects = list(outlook.close.confusion)
    parts = []
    for plan in outlook.plans:
        sure = sum(1 for key in effects if (least := outlook.smallest(key)) is not None and least <= plan.snr)
        size = f" ({_size_words(plan)})" if plan.sizes else ""
        parts.append(f"{sure} of {len(effects)} at SNR {plan.snr:g}{size}")
    text = f"Effects that this campaign would name rightly nine times in ten: {', '.join(parts)}."
    never = [key for key in effects if outlook.smallest(key) is None]
    if never:
        text += f" Not even at SNR {outlook.plans[0].snr:g}: {', '.join(map(shown_key, never))}."
    for reason in dict.fromkeys(outlook.close.invisible.values()):
        names = [name for name, why in outlook.close.invisible.items() if why == reason]
        text += f" Not testable, {reason}: {', '.join(names)}."
    return text


def plan_table(outlook: Outlook) -> Table:
    """Return the prediction as a table, the effects that are easiest to name first."""
    close = outlook.close
    order = sorted(close.confusion, key=lambda key: [-_named(plan, key) for plan in reversed(outlook.plans)])
    rows = [
        [
            shown_key(key),
            *(f"{100 * _named(plan, key):.0f}" for plan in outlook.plans),
            _listed(close.sets[key], ()),
            _listed(close.confusion[key], (effect_of(key),)),
            f"{100 * close.survives[key]:.0f}",
        ]
        for key in order
    ]
    rows += [[name, *["0"] * len(outlook.plans), "—", why, "0"] for name, why in close.invisible.items()]
    return Table(
        f"What this campaign could tell apart, {close.cases} cases each",
        (
            "Hidden effect",
            *(f"Named rightly at SNR {plan.snr:g} (%)" for plan in outlook.plans),
            f"As a set with (SNR {close.snr:g})",
            f"Said instead (SNR {close.snr:g})",
            "Survives the baseline (%)",
        ),
        rows,
        "Named rightly: the answer, alone or as a set, holds the effect. " + SNR_WORDS,
    )


def shown_key(key: str) -> str:
    """Return the name of a hidden effect, with the response that it is hidden in for people: "jump (bias)"."""
    for column, response in RESPONSES.items():
        key = key.replace(f"({column})", f"({response.word})")
    return key


def _named(plan: Plan, key: str) -> float:
    return plan.outcome(key)["named"] if key in plan.confusion else 0.0


def _listed(shares: dict[str, float], but: tuple[str, ...]) -> str:
    words = (f"{name} {100 * share:.0f} %" for name, share in shares.items() if name not in but and share >= SEEN)
    return ", ".join(words) or "—"


def plan_page(outlook: Outlook, profiles: Sequence[str]) -> str:
    """Return the page of a plan as HTML."""
    effects = list(outlook.close.confusion)
    facts = []
    for plan in outlook.plans:
        sure = sum(1 for key in effects if (least := outlook.smallest(key)) is not None and least <= plan.snr)
        facts.append((f"Named nine times in ten, SNR {plan.snr:g}", f"{sure} of {len(effects)}", _size_words(plan)))
    facts.append(("Chamber time", f"{outlook.close.hours:.3g} h", "of all planned runs"))
    facts.append(("Not testable", str(len(outlook.close.invisible)), "a drive that is not stepped, or no change"))
    runs = Table("Planned runs", ("Run", "Chamber"), [[str(k + 1), words] for k, words in enumerate(profiles)])
    return render_page(
        "What a planned campaign could tell apart",
        headline(outlook),
        [
            Chapter("In short", [Facts(facts), runs, _ladder(outlook)]),
            Chapter("Every effect", [plan_table(outlook), *_sensor_table(outlook.close)]),
            Chapter("What would be said", [_matrix(outlook.close)]),
            Chapter(
                "How it was predicted",
                [
                    Text(
                        "A gyro without effects goes through the planned runs with nominal physics. Every effect is hidden in it "
                        f"{outlook.close.cases} times at each SNR, with random shapes, under white noise and, in every second "
                        "case, slow noise besides; the answers count by the rules of the diagnosis. " + SNR_WORDS
                    )
                ],
            ),
        ],
    )


def _sensor_table(plan: Plan) -> list[Table]:
    """Return what would part the sets without chamber time."""
    if not plan.sensors:
        return []
    rows = [[sensor, str(len(pairs)), ", ".join(pairs)] for sensor, pairs in plan.sensors.items()]
    note = f"Sets at SNR {plan.snr:g}. A sensor costs no chamber hour; the first parts the most sets."
    return [Table("Instead of a further run: sensors that part sets", ("Sensor", "Sets", "Which"), rows, note)]


def _size_words(plan: Plan) -> str:
    sizes = ", ".join(f"{value:.2g} {key.split(' / ')[1]}" for key, value in plan.sizes.items())
    return f"{sizes} rms"


def _ladder(outlook: Outlook) -> Picture:
    """Draw how often each effect is named at each SNR, under white and with slow noise."""
    keys = sorted(outlook.close.confusion, key=lambda key: [-_named(plan, key) for plan in reversed(outlook.plans)])
    columns = [(plan, noise) for plan in outlook.plans for noise in plan.by_noise]
    shares = np.array(
        [[plan.by_noise[noise].get(key, {}).get(effect_of(key), 0.0) for plan, noise in columns] for key in keys]
    )
    labels = [f"SNR {plan.snr:g}\n{noise} noise" for plan, noise in columns]
    return _map(
        shares,
        list(map(shown_key, keys)),
        labels,
        "How often each effect would be named rightly, %: white noise, and slow noise besides.",
    )


def _matrix(plan: Plan) -> Picture:
    """Draw the confusion matrix."""
    keys = sorted(plan.confusion)
    said = {name for shares in plan.confusion.values() for name in shares} | {effect_of(key) for key in keys}
    names = [*sorted(said - {NOTHING}), NOTHING]
    shares = np.array([[plan.confusion[key].get(name, 0.0) for name in names] for key in keys])
    caption = (
        f"Rows the hidden effect, columns the answer, % of {plan.cases} cases at SNR {plan.snr:g}; nothing: it would stay "
        "unseen."
    )
    return _map(shares, list(map(shown_key, keys)), names, caption, 55.0)


def _map(shares: np.ndarray, rows: Sequence[str], columns: Sequence[str], caption: str, turn: float = 0.0) -> Picture:
    with figure(height=0.25 * len(rows) + (1.8 if turn else 0.8)) as (made, axes):
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        axes.grid(False)
        side = {"ha": "right", "rotation_mode": "anchor"} if turn else {"ha": "center"}
        axes.set_xticks(range(len(columns)), columns, rotation=turn, fontsize=8, **side)
        axes.set_yticks(range(len(rows)), rows, fontsize=8)
        for i, j in zip(*np.nonzero(np.round(100 * shares)), strict=True):
            colour = "w" if shares[i, j] > 0.55 else "k"
            axes.text(j, i, f"{100 * shares[i, j]:.0f}", ha="center", va="center", fontsize=7, color=colour)
        return draw(made, caption, caption)
