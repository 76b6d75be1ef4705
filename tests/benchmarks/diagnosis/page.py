"""The benchmark as one self-contained page: pictures first, tables beside them, baselines and the plan's promise."""

from collections import Counter
from pathlib import Path

import numpy as np

from studies.reports.page import Chapter, Facts, Table, Text, draw, render_page
from studies.reports.style import BLUE, GREEN, ORANGE, PURPLE, VERMILION, figure
from tests.benchmarks.diagnosis.baselines import METHODS, as_cases, read_answers
from tests.benchmarks.diagnosis.cases import key_of, read_cases
from tests.benchmarks.diagnosis.plan_check import (
    FEWEST,
    POOLS,
    WITHIN,
    agreement,
    compare,
    largest,
    plan_of,
    planned_cases,
    read_predictions,
)
from tests.benchmarks.diagnosis.scoring import (
    NOTHING,
    SNR_ROWS,
    UNEXPLAINED,
    alarmed,
    all_found,
    band,
    claims,
    confusion,
    coverage,
    exact_set,
    first_right,
    floor_ratio,
    named_anything,
    named_without_warning,
    of_kind,
    reliability,
    share_of,
    short_rate,
)
from tests.benchmarks.diagnosis.summary import summarise
from tests.generator.noises import FAMILIES

OWN = "this diagnosis"
COLOURS = {OWN: BLUE, "white BIC": ORANGE, "lasso": GREEN, "stepwise": VERMILION}


def write_report(path, target):
    """Write the page (or, for a name ending in .md, the plain text) of a file of cases; return where."""
    cases = read_cases(path)
    if target.suffix == ".md":
        text = summarise(cases)
    else:
        if target.suffix != ".html":
            target = target / "diagnosis-benchmark.html"
        text = benchmark_page(cases, read_answers(path), read_predictions(path))
    Path(target).parent.mkdir(parents=True, exist_ok=True)
    Path(target).write_text(text, encoding="utf-8")
    return target


def benchmark_page(cases, answers, predictions):
    """Return the page as HTML."""
    chapters = [Chapter("In short", [_facts(cases), *_provenance(cases)])]
    chapters.append(Chapter("Right class over SNR", [_curve(cases, answers)]))
    chapters.append(Chapter("Beside the baselines", [*_baselines(cases, answers)]))
    chapters.append(Chapter("False alarms", [_alarms(cases)]))
    singles = planned_cases(cases)
    levels = sorted({c["snr"] for c in singles}, reverse=True)
    chapters.append(
        Chapter("Truth and answer", [_matrix([c for c in singles if c["snr"] == snr], snr) for snr in levels])
    )
    chapters.append(Chapter("What no library knows", _aliens(cases)))
    chapters.append(Chapter("Is the stated probability right?", _reliability(cases)))
    chapters.append(Chapter("Held-out residual", _ratios(cases)))
    chapters.append(Chapter("Do the 90 % intervals cover?", _coverage(cases)))
    if predictions:
        chapters.append(Chapter("What the plan promises", _plan(singles, predictions)))
    return render_page(
        "Diagnosis on the independent generator",
        f"{len(cases)} campaigns of virtual gyros with one hidden effect, two, none, or one that no library knows; the "
        "generator shares no code with the diagnosis. Bands are 90 % (Wilson).",
        chapters,
        ("E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209", "U. Fasel et al., Proc. R. Soc. A 478 (2022) 20210904"),
    )


def _facts(cases):
    facts = []
    for snr in SNR_ROWS:
        hits, total = share_of(of_kind(cases, "effect", snr=snr), first_right)
        facts.append((f"right class at SNR {snr:g}", _percent(hits, total), _band_words(hits, total)))
    for label, kind, holds in (
        ("false alarms", "null", alarmed),
        ("aliens given a name alone", "alien", named_without_warning),
        ("two effects, exact set", "pair", exact_set),
    ):
        hits, total = share_of(of_kind(cases, kind), holds)
        facts.append((label, _percent(hits, total), _band_words(hits, total)))
    return Facts(facts)


def _percent(hits, total):
    return f"{100 * hits / total:.1f} %" if total else "—"


def _band_words(hits, total):
    low, high = band(hits, total)
    return f"{hits} of {total}; {100 * low:.1f}–{100 * high:.1f} %" if total else "no cases"


def _provenance(cases):
    commits = Counter(c["commit"] or "not recorded" for c in cases)
    kinds = Counter(c["kind"] for c in cases)
    return [
        Text(
            "Cases: "
            + ", ".join(f"{n} {kind}" for kind, n in kinds.most_common())
            + ". Program: "
            + ", ".join(f"{commit} ({n})" for commit, n in commits.most_common())
            + ". Right class: the truth is in the strongest cause's set. “without”: the hidden effect was taken out of the"
            " library. “faint”: one effect at SNR 0.3 to 0.03."
        )
    ]


def _curve(cases, answers):
    tried = _tried(cases, answers)
    with figure(height=3.6) as (made, axes):
        for number, (method, mine) in enumerate(tried.items()):
            singles = planned_cases(mine)
            levels = sorted({c["snr"] for c in singles})
            points = [share_of([c for c in singles if c["snr"] == snr], first_right) for snr in levels]
            bands = np.array([band(*p) for p in points]) * 100
            rates = np.array([100 * h / t for h, t in points])
            x = np.array(levels) * 1.03 ** (number - 1.5)
            errors = np.abs(bands.T - rates)
            axes.errorbar(x, rates, errors, marker="o", capsize=3, color=COLOURS[method], label=method)
        axes.set_xscale("log")
        ticks = sorted({c["snr"] for c in planned_cases(cases)})
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.minorticks_off()
        axes.set(xlabel="SNR", ylabel="right class / %", ylim=(-3, 103))
        axes.legend(loc="lower right")
        caption = "Share of hidden effects whose strongest answer holds them, with 90 % bands."
        if len(tried) > 1:
            caption += " Baselines on the cases that they answered (no faint ones), the diagnosis on all."
        return draw(made, caption, "Right class over SNR for the diagnosis and three baselines")


def _tried(cases, answers):
    tried = {OWN: cases}
    for method in METHODS:
        if answers:
            tried[method] = as_cases(cases, answers, method)
    return tried


def _baselines(cases, answers):
    if not answers:
        return [Text("No baselines were run on these cases (--baselines).", "note")]
    tried = {method: as_cases(cases, answers, method) for method in METHODS}
    shared = set(answers)

    tried = {OWN: [c for c in cases if key_of(c) in shared], **tried}

    def row(label, kind, holds, **wanted):
        return [label, *(short_rate(*share_of(of_kind(mine, kind, **wanted), holds)) for mine in tried.values())]

    rows = [row(f"false alarm, {family}", "null", alarmed, family=family) for family in FAMILIES]
    rows.append(row("false alarm, all noises", "null", alarmed))
    rows += [row(f"right class, SNR {snr:g}", "effect", first_right, snr=snr) for snr in SNR_ROWS]
    for snr in SNR_ROWS:
        rows.append(row(f"more than one cause named, SNR {snr:g}", "effect", lambda c: len(c["causes"]) > 1, snr=snr))
    rows.append(row("alien given a library name", "alien", named_anything))
    rows.append(row("alien given a name and no warning", "alien", named_without_warning))
    rows.append(row("effect not in the library: a name, no warning", "without", named_without_warning))
    rows.append(row("two effects: both found", "pair", all_found))
    rows.append(row("two effects: exact set", "pair", exact_set))
    times = [f"{np.median([c['seconds'] for c in mine]):.2f}" for mine in tried.values()]
    rows.append(["median seconds a case", *times])
    return [
        Table(
            "The same records, four methods: rate / % [90 % band] (count)",
            ("question", *tried),
            rows,
            "Seconds: the diagnosis with its held-out residuals by the clock, the baselines by processor time.",
        ),
        Text(
            "All get the campaign as the diagnosis reads it, its baseline and its lag. Stepwise: polynomial and product terms, "
            "ordinary least squares, p < 0.001, terms mapped to the effect that they would stand for. Lasso: the diagnosis' "
            "own signatures, blocked cross-validation, one-standard-error penalty, 20 block bootstraps, named when in 80 % "
            "of them. White BIC: the diagnosis' own signatures and polish, white noise, BIC > 0. Inseparable effects count "
            "as named for all; no baseline can say “unexplained”."
        ),
    ]


def _alarms(cases):
    rows = []
    for family in (*FAMILIES, "all"):
        mine = [c for c in of_kind(cases, "null") if family in (c["family"], "all")]
        named = share_of(mine, named_anything)
        left = share_of(mine, lambda c: not c["causes"] and c["verdict"] == UNEXPLAINED)
        rows.append([family, *(short_rate(*pair) for pair in (share_of(mine, alarmed), named, left))])
    return Table(
        "Campaigns that hide nothing: rate / % [90 % band] (count)",
        ("noise", "any alarm", "an effect named", "unexplained only"),
        rows,
    )


def _matrix(cases, snr):
    table = confusion(cases)
    truths = list(table)
    answers = {name for row in table.values() for name in row} | {truth.split("@")[0] for truth in truths}
    columns = [*sorted(answers - {NOTHING, UNEXPLAINED}), NOTHING, UNEXPLAINED]
    shares = np.array([[table[t][s] / sum(table[t].values()) for s in columns] for t in truths])
    with figure(height=0.27 * len(truths) + 2.2) as (made, axes):
        axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
        axes.grid(False)
        axes.set_xticks(range(len(columns)), columns, rotation=55, ha="right", rotation_mode="anchor", fontsize=8)
        axes.set_yticks(range(len(truths)), [f"{t} ({sum(table[t].values())})" for t in truths], fontsize=8)
        axes.axvline(len(columns) - 2.5, color="#5b6470", linewidth=0.8)
        for i, j in zip(*np.nonzero(shares), strict=True):
            dark = shares[i, j] > 0.55
            axes.text(
                j, i, f"{100 * shares[i, j]:.0f}", ha="center", va="center", fontsize=7, color="w" if dark else "k"
            )
        axes.set_title(f"SNR {snr:g}, {len(cases)} cases", loc="left", fontsize=10)
        return draw(
            made,
            f"SNR {snr:g}: rows the truth (cases), columns the answer, per cent of the row. An answer whose set holds the "
            "truth counts as the truth; @ marks effects hidden in another response than usual.",
            f"Confusion matrix at SNR {snr:g}",
        )


def _aliens(cases):
    rows = []
    for kind, label in (("alien", "alien"), ("without", "effect not in the library")):
        mine = of_kind(cases, kind)
        for name in ["all", *sorted({c["alien"] or c["raw"][0] for c in mine})]:
            of = [c for c in mine if name in ("all", c["alien"] or c["raw"][0])]
            words = Counter(
                UNEXPLAINED if c["verdict"] == UNEXPLAINED else c["causes"][0][0] if c["causes"] else NOTHING
                for c in of
            )
            warned = words.pop(UNEXPLAINED, 0)
            others = ", ".join(f"{word} {n}" for word, n in words.most_common()) if name != "all" else ""
            rows.append([f"{label}: {name}", short_rate(warned, len(of)), others or "—"])
    return [
        Table(
            "Hidden at SNR 3: called unexplained, rate / % [90 % band] (count)",
            ("what was hidden", "unexplained", "else"),
            rows,
            "With ageing or clock-drift taken out, the other one explains the record exactly: no record could object.",
        )
    ]


def _reliability(cases):
    stated = claims(cases)
    rows, error = reliability(stated)
    known = claims([c for c in cases if c["kind"] != "alien"])
    known_error = reliability(known)[1]
    if not rows:
        return [Text("No claims.", "note")]
    with figure(height=3.6) as (made, axes):
        x = np.array([r[2] for r in rows])
        y = np.array([r[3] / r[4] for r in rows])
        bands = np.array([band(r[3], r[4]) for r in rows])
        axes.plot([0, 1], [0, 1], color="#5b6470", linewidth=0.8)
        axes.errorbar(x, y, np.abs(bands.T - y), fmt="o", color=BLUE, capsize=3)
        # bins of high claims crowd in the corner: their counts are in the table below
        axes.set(xlabel="stated probability", ylabel="share right", xlim=(0, 1.02), ylim=(0, 1.02))
        picture = draw(made, "Stated probability and share right, 90 % bands.", "Reliability diagram")
    return [
        picture,
        Table(
            "Claims",
            ("stated", "mean claim", "right: rate / % [90 % band] (count)"),
            [[f"{r[0]:.2f}–{r[1]:.2f}", f"{r[2]:.3f}", short_rate(r[3], r[4])] for r in rows],
            f"Expected calibration error {error:.3f} on {len(stated)} claims; without the aliens, which are more frequent here "
            f"than in a laboratory, {known_error:.3f} on {len(known)}.",
        ),
    ]


def _ratios(cases):
    by_snr = {}
    for snr in SNR_ROWS:
        right = [c for c in of_kind(cases, "effect", snr=snr) if first_right(c)]
        by_snr[snr] = np.array([r for c in right if (r := floor_ratio(c)) is not None])
    by_snr = {snr: ratios for snr, ratios in by_snr.items() if ratios.size}
    if not by_snr:
        return [Text("No held-out residuals in these cases.", "note")]
    with figure(height=3.2) as (made, axes):
        for (snr, ratios), colour in zip(by_snr.items(), (BLUE, ORANGE, PURPLE), strict=False):
            ordered = np.sort(ratios)
            axes.step(ordered, 100 * np.arange(1, ordered.size + 1) / ordered.size, color=colour, label=f"SNR {snr:g}")
        axes.axvline(1.1, color="#5b6470", linewidth=0.8, linestyle="--")
        axes.set(xlabel="held-out residual over noise", ylabel="cases below / %", xlim=(0.9, 1.6), ylim=(0, 101))
        axes.legend(loc="lower right")
        picture = draw(
            made,
            "Residual on the run that was left out over the noise, right name; the line is at 1.1.",
            "Distribution of the held-out ratio",
        )
    rows = [
        [
            f"{snr:g}",
            f"{np.median(ratios):.3f}",
            f"{np.quantile(ratios, 0.9):.2f}",
            short_rate(int((ratios < 1.1).sum()), ratios.size),
            short_rate(int((ratios < 1.05).sum()), ratios.size),
        ]
        for snr, ratios in by_snr.items()
    ]
    return [picture, Table("Held-out residual over noise", ("SNR", "median", "90 % below", "< 1.1", "< 1.05"), rows)]


def _coverage(cases):
    found = coverage(cases)
    if not found:
        return [Text("These cases carry no parameters.", "note")]
    rows, hits, total = [], 0, 0
    for (effect, name), values in found.items():
        covered, errors = sum(v[0] for v in values), np.array([v[2] for v in values])
        hits, total = hits + covered, total + len(values)
        rows.append(
            [effect, name, short_rate(covered, len(values)), f"{100 * np.median(errors):+.1f}",
             f"{100 * np.median(np.abs(errors)):.1f}"]
        )  # fmt: skip
    rows.append(["all", "", short_rate(hits, total), "", ""])
    return [
        Table(
            "Parameters that mean the same in generator and library; effect named, SNR 3 to 0.3",
            ("effect", "parameter", "covered: rate / % [90 % band] (count)", "median error / %", "median |error| / %"),
            rows,
            "The generator's forms are not the library's (chains of nodes, relays, coupled modes): a part of each error is "
            "the difference of definitions. Errors of temperatures are relative to the value in °C.",
        )
    ]


def _plan(cases, predictions):
    plans = predictions["plans"]
    cases = [c for c in cases if plan_of(c) in plans]
    if not cases:
        return [Text("No case of these designs and SNR was planned.", "note")]
    summary, beyond = [], []
    for title, pool in POOLS.items():
        for outcomes in (True, False):
            entries = compare(cases, plans, pool, outcomes)
            found = agreement(entries)
            if found["entries"]:
                summary.append(
                    [
                        f"by {title}, {'four outcomes' if outcomes else 'every answer'}",
                        str(found["entries"]),
                        f"{found['near']} ({100 * found['near'] / found['entries']:.0f} %)",
                        f"{found['open_near']} of {found['open']}",
                        f"{found['beyond']} ({100 * found['beyond'] / found['entries']:.0f} %)",
                        f"{100 * found['rms']:.1f}",
                        f"{found['rank']:.2f}",
                    ]
                )
            if outcomes:
                beyond += largest(entries, 5)
    table = Table(
        f"Predicted against measured shares of {len(cases)} cases, entries of {FEWEST} cases or more",
        ("pool", "entries", f"within {100 * WITHIN:.0f} points", "those predicted at 5–95 %", "outside the 90 % band", "error beyond chance / points",
         "rank agreement"),
        summary,
        "Four outcomes: named, nothing, unexplained, wrong. Band: where nine of ten counts would lie were the prediction "
        "right; up to one entry in ten is outside by chance. Error beyond chance: rms difference less what chance gives.",
    )  # fmt: skip
    worst = Table(
        "Furthest outside their band",
        ("pool", "outcome", "predicted / %", "90 % band / %", "measured / %", "cases"),
        [
            [e.pool, e.said, f"{100 * e.predicted:.0f}", f"{100 * e.low:.0f}–{100 * e.high:.0f}",
             f"{100 * e.measured:.0f}", str(e.cases)]
            for e in sorted(beyond, key=lambda e: -abs(e.predicted - e.measured))
        ],
    )  # fmt: skip
    words = Text(
        "The plan gets the temperatures and drives of a design, with one gyro that hides nothing, and slow noise of random kind "
        "and strength. Every case is compared with the prediction for its own design, effect, SNR and noise, white or slow; "
        "cases with gross outliers with that for white noise at the SNR that their other rows have. Program of the prediction: "
        f"{predictions['commit']}, {predictions['draws']} cases each."
    )
    return [words, table, _plan_picture(cases, plans), *([worst] if beyond else [])]


def _plan_picture(cases, plans):
    colours = {"named": BLUE, NOTHING: ORANGE, UNEXPLAINED: PURPLE, "wrong": VERMILION}
    with figure(1, 2, height=3.9) as (made, axes):
        for ax, title in zip(axes, ("effect", "design and SNR"), strict=True):
            entries = [e for e in compare(cases, plans, POOLS[title], outcomes=True) if e.cases >= FEWEST]
            ax.fill_between([-10, 110], [-20, 100], [0, 120], color="#d5dae0", alpha=0.5, linewidth=0)
            for word, colour in colours.items():
                own = [e for e in entries if e.said == word]
                if own:
                    y = np.array([100 * e.measured for e in own])
                    bands = 100 * np.array([band(round(e.measured * e.cases), e.cases) for e in own])
                    x = [100 * e.predicted for e in own]
                    ax.errorbar(x, y, np.abs(bands.T - y), fmt="o", ms=3.5, lw=0.7, color=colour, label=word)
            ax.plot([0, 100], [0, 100], color="#5b6470", linewidth=0.8)
            ax.set(xlabel="predicted / %", ylabel="measured / %", xlim=(-3, 103), ylim=(-3, 103))
            ax.set_title(f"pooled by {title}", loc="left", fontsize=10)
        if axes[0].get_legend_handles_labels()[0]:
            axes[0].legend(loc="lower right", fontsize=8)
        return draw(
            made,
            "Predicted and measured shares of the four outcomes with 90 % bands of the count; grey: within ten points.",
            "Predicted against measured shares of the four outcomes",
        )
