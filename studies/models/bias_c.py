"""The C99 source of a bias model: causal, one call per sample, and a table of its own to test it with."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from compensation.bias import PLAY, TERMS
from compensation.memory import Memory
from studies.models.c_source import head, self_test
from studies.models.file import Model


@dataclass(frozen=True)
class CausalBias:
    """What the code of `kinds.bias` computes: terms over a column about its `reference`, behind `memory`, with the rate's window and lag."""

    column: str
    unit: str
    reference: float
    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    memory: Memory
    window: float
    lag: float
    block: float
    blocks: int
    values: tuple[float, float]
    rates: tuple[float, float]


def write_c(model: Model, law: CausalBias, rows: Sequence[Sequence[float]]) -> str:
    """Return `hrg_bias`, `hrg_bias_reset` and `hrg_compensate` in C99, with rows (time, output, value, expected) to test."""
    window, lag, length, memory = law.window, law.lag, law.block, law.memory
    (low, high), (r_low, r_high) = law.values, law.rates
    total = "\n        + ".join(
        [f"({law.coefficients[0]!r})"]
        + [f"({value!r}){_product(name)}" for name, value in zip(law.terms, law.coefficients[1:], strict=True)]
    )
    warning = "" if lag else " The model was fitted with a centred rate: fit it with --causal to match this code."
    return f"""{head(model)}
/* The input `value` is {law.column}. Samples are averaged over {length:g} s; when a block is complete, its mean and the slope of
   the line through the blocks of the last {window:g} s give the bias, which holds until the next block is complete. The
   rate lags by {window / 2:g} s.{warning} A NaN is a missing value; outliers are for the caller to leave out. */
#define HRG_BLOCK_S {length!r}
#define HRG_WINDOW_S {window!r}
#define HRG_LAG_S {memory.lag!r}
#define HRG_PLAY {memory.play!r}
#define HRG_BLOCKS {ceil(window / length) + 2}

typedef struct {{
    double start, zero;               /* time and value of the first sample */
    double number, sum_t, sum_x, n;   /* the block that is being filled */
    double time[HRG_BLOCKS], mean[HRG_BLOCKS];
    int blocks;                       /* complete ones that are kept, oldest first */
    double raw, play, bias;
    int started, any, ready;
}} hrg_bias_state;

/* Bias ({law.unit}) at a value of the input, its rate per second, and its play. */
double hrg_bias(double value, double rate, double play) {{
    double f = value - ({law.reference!r}), r = rate;
    (void)f;
    (void)r;
    (void)play;
    return {total};
}}

/* Call once before the first sample. */
void hrg_bias_reset(hrg_bias_state *s) {{
    const hrg_bias_state zero = {{0}};
    *s = zero;
}}

static void hrg_finish_block(hrg_bias_state *s) {{
    double t = s->start + s->sum_t / s->n, x = s->zero + s->sum_x / s->n, y = x;
    int last, k;
    if (HRG_LAG_S > 0.0 && s->any) {{  /* lag of an input that is linear between the blocks, exactly */
        double before = s->mean[s->blocks - 1], step = (t - s->time[s->blocks - 1]) / HRG_LAG_S;
        double rise = (x - s->raw) * (-expm1(-step) / step);
        y = x - rise + (before - s->raw) * exp(-step);
    }}
    s->play = !s->any ? y : fmin(fmax(s->play, y - HRG_PLAY), y + HRG_PLAY);
    s->raw = x;
    s->any = 1;
    if (s->blocks == HRG_BLOCKS) {{
        for (k = 1; k < HRG_BLOCKS; ++k) {{
            s->time[k - 1] = s->time[k];
            s->mean[k - 1] = s->mean[k];
        }}
        s->blocks--;
    }}
    s->time[s->blocks] = t;
    s->mean[s->blocks++] = y;
    last = s->blocks - 1;
    for (k = 0; s->time[k] < t - HRG_WINDOW_S - 1e-6; ++k) {{}}
    s->ready = last - k >= {law.blocks - 1} && t - s->time[k] >= 0.5 * HRG_WINDOW_S;
    if (s->ready) {{
        double n = last - k + 1, mt = 0.0, mx = 0.0, tx = 0.0, tt = 0.0, rate;
        int i;
        for (i = k; i <= last; ++i) {{
            mt += (s->time[i] - t) / n;
            mx += (s->mean[i] - y) / n;
        }}
        for (i = k; i <= last; ++i) {{
            double u = s->time[i] - t - mt;
            tx += u * (s->mean[i] - y - mx);
            tt += u * u;
        }}
        rate = tx / tt;
        s->ready = y >= {low!r} && y <= {high!r} && rate >= {r_low!r} && rate <= {r_high!r};
        s->bias = hrg_bias(y, rate, s->play - y);
    }}
}}

/* Output with the bias taken out; *ok is 0, and the output is as it was, while the rate is unknown or the input outside
   the calibrated range. time_s increases from call to call. */
double hrg_compensate(hrg_bias_state *s, double time_s, double output, double value, int *ok) {{
    if (value == value) {{
        double number;
        if (!s->started) {{
            s->started = 1;
            s->start = time_s;
            s->zero = value;
        }}
        number = floor((time_s - s->start) / HRG_BLOCK_S);
        if (number != s->number && s->n > 0.0) {{
            hrg_finish_block(s);
            s->sum_t = s->sum_x = s->n = 0.0;
        }}
        s->number = number;
        s->sum_t += time_s - s->start;
        s->sum_x += value - s->zero;
        s->n += 1.0;
    }}
    *ok = s->ready && time_s - s->time[s->blocks - 1] <= HRG_WINDOW_S;
    return *ok ? output - s->bias : output;
}}

{self_test(rows, "time_s, output, value, expected (NaN: not ok)", STEP)}"""


STEP = """    static hrg_bias_state state;
    int ok;
    double found = hrg_compensate(&state, row[0], row[1], row[2], &ok), expected = row[3];
    if (!ok) return expected == expected;"""


def _product(name: str) -> str:
    if name == PLAY:
        return " * play"
    a, b = TERMS[name]
    return " * f" * a + " * r" * b
