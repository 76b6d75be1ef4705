/* The library of effects, row by row, and noise: each case is the formula of the file of that name in the workbench. */
#include <math.h>
#include <string.h>

#include "twin.h"

static const double PI = 3.14159265358979323846, ZERO = 273.15, AROUND = 293.15, DAY = 86400.0;

/* tau y' = u - y for a drive that is linear between rows; memory: y, last u, begun. */
static double lag(double *memory, double u, double h, double tau) {
    if (memory[2] == 0.0) {
        memory[0] = u;
        memory[2] = 1.0;
    } else {
        const double ratio = h / tau, decay = exp(-ratio), ramp = ratio > 1e-12 ? -expm1(-ratio) / ratio : 1.0;
        memory[0] = decay * memory[0] + (1 - ramp) * u + (ramp - decay) * memory[1];
    }
    memory[1] = u;
    return memory[0];
}

/* What the resonator makes of a change u of its housing (way 1) or of heat in its shell (way 2). */
static double taken_up(double *memory, double u, double h, int way) {
    double y = 0.0;
    for (int k = 0; k < TWIN_LAGS; ++k) y += twin_lags[k][way] * lag(memory + 3 * k, u, h, twin_lags[k][0]);
    return y;
}

static double play(double *memory, double u, double r, double start) {
    memory[0] = memory[1] == 0.0 ? u + start * r : fmin(u + r, fmax(u - r, memory[0]));
    memory[1] = 1.0;
    return memory[0];
}

static double held(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

/* Sum of weights times cos(k pi u), k = 2 ..., of the place u in a range. */
static double waves(const double *weights, int count, double T, double low, double high) {
    const double u = held((T - low) / fmax(high - low, 1e-9), 0.0, 1.0);
    double sum = 0.0;
    for (int k = 0; k < count; ++k) sum += weights[k] * cos(PI * u * (k + 2));
    return sum;
}

/* Sum of weights times the integrals of sines over the envelope of a hysteresis. */
static double curves(const double *weights, double T, double low, double high) {
    double sum = 0.0;
    for (int k = 0; k < 8; ++k) {
        const double turn = PI * (k + 1) / fmax(high - low, 1e-9);
        sum += weights[k] * cos(held(T - low - ZERO, 0.0, fmax(high - low, 0.0)) * turn) / turn;
    }
    return sum;
}

static double power_series(const double *weights, int count, double x, int first) {
    double sum = 0.0;
    for (int k = count - 1; k >= 0; --k) sum = sum * x + weights[k];
    return sum * pow(x, first);
}

double twin_effect(Twin *w, const TwinEffect *e, const TwinInput *in, double h, double housing, double resonator, double rate) {
    const double *s = w->p + e->shape, *a = w->p + e->weights, x = (resonator - TWIN_REFERENCE) / 10;
    const double angle = (in->given[IN_ANGLE] ? in->value[IN_ANGLE] : w->p[P_bias_pattern_angle_deg]) * PI / 180;
    const double amplitude = in->value[IN_AMPLITUDE] * in->value[IN_AMPLITUDE], volts = in->value[IN_VOLTAGE] * in->value[IN_VOLTAGE];
    const double t = w->time + fmax(w->p[P_start_s] - e->since, 0.0); /* since its date */
    const double tau = twin_lags[0][0], quadrature = in->value[IN_QUADRATURE];
    const int f = e->target == TARGET_FREQUENCY;
    double *m = w->memory + e->memory, y = 0.0;
    switch (e->kind) {
    case E_second_lag: {
        const double ratio[3] = {1.0, 1.0 / 3, 3.0}, first = taken_up(m + 9, housing, h, 1);
        for (int k = 0; k < 3; ++k) y += a[k] * (lag(m + 3 * k, housing, h, s[0] * ratio[k]) - first);
        return y;
    }
    case E_thermometer_scale:
        if (s[0] > 0) return 0.0;
        y = power_series(a, 3, (housing - TWIN_REFERENCE) / 10, 2) + a[3] * (housing - TWIN_REFERENCE) / 10 + a[4];
        return taken_up(m, y, h, 1);
    case E_thermometer_lag:
        for (int k = 0; k < TWIN_LAGS; ++k) y += twin_lags[k][1] * (housing - lag(m + 3 * k, housing, h, twin_lags[k][0])) / twin_lags[k][0];
        return a[0] * y;
    case E_self_heating: {
        const double ratio[3] = {0.1, 1.0 / 3, 3.0}, first = taken_up(m + 9, amplitude, h, 2);
        y = a[0] * first;
        for (int k = 0; k < 3; ++k) y += a[k + 1] * (lag(m + 3 * k, amplitude, h, tau * ratio[k]) - first);
        return in->given[IN_AMPLITUDE] ? y : 0.0;
    }
    case E_radiation:
        for (int k = 0; k < (s[0] != 0 ? 5 : 1); ++k) {
            const double state = resonator + s[0] * y, both = (housing + state) * (housing * housing + state * state);
            const double g = s[1] != 0 ? both / (4 * pow(AROUND, 3)) : pow(state / AROUND, 3);
            double *own = m + 3 * TWIN_LAGS * k;
            for (int i = 0; i < TWIN_LAGS; ++i) own[3 * i + 2] = 1.0; /* it begins at nothing, driven by nothing */
            y = taken_up(own, (g - 1) * (housing - state), h, 2);
        }
        return a[0] * y;
    case E_clock_offset: return s[0] >= 1 ? 0.0 : -a[0] * rate;
    case E_activity_dip:
        for (int k = 0; k < 4; ++k) {
            const double wide[4] = {1.0, 2.0, 1.0, 3.0}, z = (resonator - ZERO - s[0]) / (s[1] * wide[k]), root = sqrt(z * z + 1);
            const double pull = z / (1 + z * z), loss = 1 / (1 + z * z), hop = (z > 0) - (z < 0);
            if (k < 2) y += a[2 * k] * (f ? pull : loss) + a[2 * k + 1] * (f ? loss : pull);
            else y += a[k + 2] * (f ? hop * (root - fabs(z)) : 1 - fabs(z) / root);
        }
        return y;
    case E_ageing: return a[0] * log1p(t / s[0]) - a[1] * expm1(-t / s[0] / 3) + a[2] * t / s[0];
    case E_amplitude_frequency: return in->given[IN_AMPLITUDE] ? a[0] * amplitude + a[1] * amplitude * amplitude : 0.0;
    case E_axis_rotation: {
        const double across = 4 * (angle - s[0] * PI / 180 * x);
        return a[0] * sin(across) + a[1] * cos(across);
    }
    case E_clock_drift: return a[0] * t / DAY;
    case E_cross_damping: {
        const int still = s[3] == -90.0;
        y = still ? power_series(a + 4, 4, x, 4) : power_series(a, 8, x, 0);
        y += waves(a + 8, 11, resonator - ZERO, s[0], s[1]);
        if (!still) y *= sin(4 * (angle - s[3] * PI / 180));
        return s[2] > 0 ? lag(m, y, h, s[2]) : y;
    }
    case E_curvature: return power_series(a, 4, x, 3) + waves(a + 4, 19, resonator - ZERO, s[0], s[1]);
    case E_electrostatic_softening: return in->given[IN_VOLTAGE] ? -a[0] * volts - a[1] * volts * volts : 0.0;
    case E_hysteresis: {
        const double ratio[5] = {1.0, 0.4, 0.7, 1.5, 2.2}, start = s[1] == 2.0 ? 0.0 : s[1];
        for (int k = 0; k < 5; ++k) y += a[k] * (play(m + 2 * k, resonator, s[0] * ratio[k], start) - resonator);
        return y + curves(a + 5, m[0], s[2], s[3]) - curves(a + 5, resonator, s[2], s[3]);
    }
    case E_jump: {
        const double relaxing[3] = {300.0, 1000.0, 3000.0}, end = fmax(t + h / 2 - s[1], 0.0), begin = fmax(end - h, 0.0);
        if (s[0] >= 1) return 0.0;
        y = a[0] * (end - begin) / h;
        for (int k = 0; k < 3; ++k) y += a[k + 1] * relaxing[k] / h * (exp(-begin / relaxing[k]) - exp(-end / relaxing[k]));
        return y;
    }
    case E_leak: {
        const double days = t / DAY, grown = s[1] > 0 ? -expm1(-t / s[1]) * s[1] / DAY : days;
        return (a[0] * grown + a[1] * sqrt(days)) * pow(resonator / AROUND, s[0] + 0.5) * sqrt(AROUND / resonator);
    }
    case E_loss_peak: {
        const double peak = s[0] + ZERO, z = peak * peak / s[1] * (1 / resonator - 1 / peak);
        return a[0] / cosh(fmin(fabs(z), 300.0));
    }
    case E_mounting_stress: {
        const double ratio[3] = {1.0, 1.0 / 3, 3.0}, across = f ? housing - resonator : 0.0;
        for (int k = 0; k < 3; ++k) y += a[k] * (resonator - lag(m + 3 * k, resonator, h, s[0] * ratio[k]));
        const double relaxing = lag(m + 9, across, h, s[0]);
        y += a[3] * across + a[4] * relaxing + a[5] * across * pow(across / 30, 2);
        for (int k = 0; k < 4; ++k) {
            const double u = across - (k > 1 ? 0.5 * relaxing : 0.0), most = k % 2 ? 30.0 : 10.0;
            y += a[6 + k] * (u / sqrt(1 + pow(u / most, 2)) - u);
        }
        return y;
    }
    case E_periodic: {
        const double *own = a + (s[1] == 2.0 ? 6 : 0); /* of the first run */
        for (int k = 0; k < 3; ++k) y += own[k] * sin(2 * PI * (k + 1) * t / s[0]) + own[k + 3] * cos(2 * PI * (k + 1) * t / s[0]);
        return y;
    }
    case E_quadrature_leakage: return in->given[IN_QUADRATURE] ? quadrature * (a[0] + a[1] * x) : 0.0;
    case E_rate_bias:
        y = a[0] * rate + a[1] * rate * 10 * x;
        return y + a[2] * (lag(m, rate, h, 60.0) - rate) + a[3] * (lag(m + 3, rate, h, 300.0) - rate);
    case E_rate_frequency: return a[0] * rate;
    default: return 0.0;
    }
}

/* xoshiro256** (Blackman and Vigna 2018), seeded by splitmix64; normal numbers by Marsaglia's polar method. */
void twin_seed(Twin *w, uint64_t seed) {
    for (int k = 0; k < 4; ++k) {
        uint64_t z = seed += 0x9e3779b97f4a7c15u;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        w->random[k] = z ^ (z >> 31);
    }
    w->has_spare = 0;
}

static uint64_t rotated(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

static double uniform(uint64_t *s) {
    const uint64_t result = rotated(s[1] * 5, 7) * 9, t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotated(s[3], 45);
    return (double)(result >> 11) * 0x1p-53;
}

double twin_normal(Twin *w) {
    double x, y, r;
    if (w->has_spare) {
        w->has_spare = 0;
        return w->spare;
    }
    do {
        x = 2 * uniform(w->random) - 1;
        y = 2 * uniform(w->random) - 1;
        r = x * x + y * y;
    } while (r >= 1 || r == 0);
    r = sqrt(-2 * log(r) / r);
    w->spare = y * r;
    w->has_spare = 1;
    return x * r;
}

/* The mean over the next x correlation times of a Gauss-Markov process of variance 1, drawn exactly with its end. */
static double next_mean(Twin *w, double *state, double x) {
    const double g = -expm1(-x) / x, decay = exp(-x);
    const double whole = x < 1e-3 ? 1 - x / 3 + x * x / 12 - x * x * x / 60 : 2 * (x + expm1(-x)) / (x * x);
    const double end = sqrt(-expm1(-2 * x)), shared = g * (1 - decay) / end, e = twin_normal(w);
    const double mean = g * *state + shared * e + sqrt(fmax(whole - g * g - shared * shared, 0.0)) * twin_normal(w);
    *state = decay * *state + end * e;
    return mean;
}

/* One row, the mean over a span: white; flicker as Gauss-Markov processes of 60 s * 4^k, k = -11 ... 6; a walk from 0;
 * an offset of the run; correlated noise. */
double twin_draw(Twin *w, TwinNoise *noise, TwinLevels level, double span) {
    double sum = level.white / sqrt(span) * twin_normal(w);
    if (!noise->begun) {
        for (int k = 0; k < FLICKER_TIMES; ++k) noise->flicker[k] = twin_normal(w);
        noise->walk = 0.0;
        noise->offset = twin_normal(w);
        noise->markov = level.markov > 0 ? twin_normal(w) : 0.0;
        noise->begun = 1;
    }
    for (int k = 0; k < FLICKER_TIMES && level.flicker > 0; ++k)
        sum += level.flicker * next_mean(w, &noise->flicker[k], span / (60 * pow(4.0, k - 11)));
    if (level.walk > 0) { /* half a step's change is in its mean, and 1/12 beside it */
        const double e = twin_normal(w);
        sum += level.walk * sqrt(span) * (noise->walk + e / 2 + twin_normal(w) / sqrt(12.0));
        noise->walk += e;
    }
    if (level.markov > 0) sum += level.markov * next_mean(w, &noise->markov, span / level.markov_time);
    return sum + level.offset * noise->offset;
}
