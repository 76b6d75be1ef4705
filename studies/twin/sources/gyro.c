/* What the gyro says at its temperatures: frequency, zero-rate output, 1/Q, through settled loops where the card has them. */
#include <math.h>
#include <string.h>

#include "twin.h"

static const double PI = 3.14159265358979323846, ZERO = 273.15, HARMONIC = 2.0;
static const double DEG_PER_H = 180.0 / 3.14159265358979323846 * 3600.0;

static double radians(double degrees) { return degrees * (PI / 180); }

void twin_defaults(Twin *w) {
    memset(w, 0, sizeof *w);
    memcpy(w->p, twin_start, sizeof w->p);
    w->step = 1.0;
    twin_seed(w, 0);
}

/* Zero-rate output of [bias], deg/h: the offset, and the paper's polynomial in the change of frequency and its rate. */
static double polynomial(const double *p, double f, double r) {
    return p[P_bias_offset_deg_per_h] + f * (p[P_bias_k1_deg_per_h_per_Hz] + f * (p[P_bias_k2_deg_per_h_per_Hz2] + f * p[P_bias_k3_deg_per_h_per_Hz3]))
           + r * (p[P_bias_k4_deg_per_h_s_per_Hz] + r * (p[P_bias_k5_deg_per_h_s2_per_Hz2] + r * p[P_bias_k6_deg_per_h_s3_per_Hz3]))
           + f * r * (p[P_bias_k7_deg_per_h_s_per_Hz2] + f * p[P_bias_k8_deg_per_h_s_per_Hz3] + r * p[P_bias_k9_deg_per_h_s2_per_Hz3]);
}

static double rounded(double value, double step) { return step > 0 ? rint(value / step) * step : value; }

/* Noise of the zero-rate output over a span, deg/h. */
static double draw_wander(Twin *w, double span) {
    const double *p = w->p;
    const TwinLevels of_bias = {60 * p[P_noise_bias_white_deg_per_rt_h], p[P_noise_bias_flicker_deg_per_h],
        p[P_noise_bias_walk_deg_per_h_per_rt_h] / 60, p[P_noise_bias_turn_on_deg_per_h], p[P_noise_bias_markov_deg_per_h],
        p[P_noise_bias_markov_s]};
    return w->noise ? twin_draw(w, &w->of_bias, of_bias, span) : 0.0;
}

/* The columns as they are read: noise, the sensor's lag and rounding. */
static void observe(Twin *w, double span) {
    const double *p = w->p;
    double *out = w->out;
    if (TWIN_SENSOR >= 0) {
        const double read = p[P_noise_housing_lag_s] > 0 ? w->T[TWIN_SENSOR] - ZERO : out[OUT_housing_temperature_degC];
        const double white = p[P_noise_housing_white_K] / sqrt(span) * twin_normal(w);
        out[OUT_housing_temperature_degC] = rounded(read + white, p[P_noise_housing_resolution_degC]);
    }
    const TwinLevels of_frequency = {p[P_noise_frequency_white_Hz], p[P_noise_frequency_flicker_Hz], p[P_noise_frequency_walk_Hz],
        0.0, p[P_noise_frequency_markov_Hz], p[P_noise_frequency_markov_s]};
    out[OUT_frequency_Hz] = rounded(out[OUT_frequency_Hz] + twin_draw(w, &w->of_frequency, of_frequency, span),
        p[P_noise_frequency_resolution_Hz]);
    out[OUT_bias_deg_per_h] = rounded(out[OUT_bias_deg_per_h] + w->wander, p[P_noise_bias_resolution_deg_per_h]);
    out[OUT_inverse_q] *= 1 + p[P_noise_inverse_q_white] / sqrt(span) * twin_normal(w);
#if TWIN_LOOPS
    out[OUT_quadrature_V] += p[P_noise_quadrature_white_V] / sqrt(span) * twin_normal(w);
#endif
#if TWIN_FREE
    out[OUT_pattern_angle_deg] += p[P_noise_pattern_angle_white_deg] / sqrt(span) * twin_normal(w);
#endif
}

/* The columns of what was said: frequency (Hz), zero-rate output (deg/h), 1/Q, quadrature (1/s). */
static void say(Twin *w, const double *said, double span) {
    w->out[OUT_frequency_Hz] = said[0];
    w->out[OUT_bias_deg_per_h] = said[1];
    w->out[OUT_inverse_q] = said[2];
#if TWIN_LOOPS
    w->out[OUT_quadrature_V] = w->p[P_loop_quadrature_V_per_Hz] * said[3] / PI;
#endif
    if (w->noise) observe(w, span);
    w->out[OUT_measured_rate_deg_per_s] = w->applied * 180 / PI + w->out[OUT_bias_deg_per_h] / 3600;
}

#if TWIN_FREE
void twin_last_row(Twin *w) {
    w->wander = draw_wander(w, w->step);
    say(w, w->said, w->step);
}
#endif

#if !TWIN_FREE
static double azimuth_of(const Twin *w, const TwinInput *in) {
    return radians(in->given[IN_ANGLE] ? in->value[IN_ANGLE] : w->p[P_bias_pattern_angle_deg]);
}
#endif

/* The resonator's temperature as much earlier as [law] says, by cubics through what has been; where it is ahead of its lags, as much later. */
static const char *displace(Twin *w, double *T, double rate) {
#if TWIN_AHEAD
    Twin later = *w;
    const char *fault = w->onward ? w->onward(&later, w->way, -TWIN_DELAY)
                                  : twin_heat(&later, -TWIN_DELAY, w->boundary, w->boundary - w->trend * TWIN_DELAY);
    for (int i = 0; i < TWIN_NODES; ++i) *T += twin_rows[0][i] * (later.T[i] - w->T[i]);
    return (void)rate, fault;
#else
    const double now[3] = {w->time, *T, rate}, at = w->time - TWIN_DELAY, *later = now;
    if (!w->pasts || w->time - w->past[(w->pasts - 1) % TWIN_PAST][0] >= 2 * TWIN_DELAY / TWIN_PAST)
        memcpy(w->past[w->pasts++ % TWIN_PAST], now, sizeof now);
    const double *sooner = w->past[(w->pasts - 1) % TWIN_PAST];
    for (long k = w->pasts - 1; k > 0 && sooner[0] > at; sooner = w->past[--k % TWIN_PAST]) later = sooner;
    const double h = later[0] - sooner[0], s = (at - sooner[0]) / h, rise = later[1] - sooner[1], one = h * sooner[2], other = h * later[2];
    *T = at <= sooner[0] ? sooner[1] + sooner[2] * (at - sooner[0])
                         : sooner[1] + s * (one + s * (3 * rise - 2 * one - other + s * (one + other - 2 * rise)));
    return NULL;
#endif
}

const char *twin_row(Twin *w, const TwinInput *in) {
    const double *p = w->p, span = w->row_time < 0 ? w->step : w->time - w->row_time;
    const double housing = TWIN_SENSOR >= 0 ? w->T[TWIN_HOUSING] : w->boundary;
    double warming[TWIN_NODES], warm[5] = {0}, rate[5] = {0}, change[TARGETS] = {0}, slope;
    if (!(span > 0)) return NULL; /* this moment has been read */
    twin_warming(w, warming);
    for (int k = 0; k < 5; ++k)
        for (int i = 0; i < TWIN_NODES; ++i) {
            warm[k] += twin_rows[k][i] * w->T[i];
            rate[k] += twin_rows[k][i] * warming[i];
        }
    const char *fault = TWIN_DELAY != 0 ? displace(w, &warm[0], rate[0]) : NULL;
    if (fault) return fault;
    for (int stage = 0; stage < 3; ++stage) { /* on the temperature; on what these leave of it; on the responses */
        const double warmed = change[TARGET_TEMPERATURE], moved = (warmed - w->last_change) / span;
        const double turning = rate[0] + (stage && w->row_time >= 0 ? moved : 0.0);
        for (int k = 0; k < TWIN_EFFECTS; ++k) {
            const TwinEffect *e = &twin_effects[k];
            if (e->kind == E_none || stage != (e->target != TARGET_TEMPERATURE ? 2 : e->kind == E_radiation)) continue;
            change[e->target] += twin_effect(w, e, in, span, housing, warm[0] + (stage ? warmed : 0.0), turning);
        }
    }
    const double T = warm[0] + change[TARGET_TEMPERATURE], excess = T - TWIN_REFERENCE;
    if (w->row_time >= 0) rate[0] += (change[TARGET_TEMPERATURE] - w->last_change) / span;
    w->last_change = change[TARGET_TEMPERATURE];
    if (!(T >= TWIN_LOWEST - 1e-6 && T <= TWIN_HIGHEST + 1e-6)) return "the resonator has left the temperatures for which the card's frequency is known.";
    double logarithm = twin_spline(&twin_law, T, &slope), uneven = 0.0;
    for (int k = 0; k < 4; ++k) {
        logarithm += twin_uneven[k] * warm[k + 1];
        uneven += twin_uneven[k] * rate[k + 1];
    }
    const double thermal = exp(logarithm), gap = 1 + TWIN_GAP_EXPANSION * excess, volts = in->value[IN_VOLTAGE];
    const double charged = in->given[IN_VOLTAGE] ? TWIN_PER_SQUARE_VOLT * (volts * volts - TWIN_VOLTAGE_SQUARED) : 0.0;
    const double stiffness = 1 + TWIN_IMPERFECTION + (TWIN_SOFTENING + charged) / (gap * gap * gap);
    if (!(stiffness > 0)) return "the electrode voltage pulls in the shell.";
    const double frequency = thermal * sqrt(stiffness) + change[TARGET_FREQUENCY];
    double loss = p[P_loss_inverse_q] * (1 + excess * (p[P_loss_slope_per_K] + p[P_loss_curvature_per_K2] * excess));
    if (twin_loss.count) loss = exp(twin_spline(&twin_loss, T, NULL));
    loss += change[TARGET_LOSS];
    if (!(loss > 0)) return "1/Q has become negative; correct [loss] or the effects on it.";
    const double axis = 2 * HARMONIC * radians(p[P_bias_damping_axis_deg]);
    double wave[2] = {p[P_bias_damping_anisotropy] * loss * cos(axis), p[P_bias_damping_anisotropy] * loss * sin(axis)};
    for (int k = 0; k < 2 && twin_wave[0].count; ++k) wave[k] = twin_spline(&twin_wave[k], T, NULL);
    const double applied = radians(in->given[IN_RATE] ? in->value[IN_RATE] : 0.0);
    const double straight = TWIN_BIAS_SLOPE * excess, bent = thermal - TWIN_REFERENCE_FREQUENCY - straight;
    const double felt = polynomial(p, straight + TWIN_BIAS_BEND * bent, thermal * (slope * rate[0] + uneven)) + change[TARGET_BIAS];
    double *out = w->out;
#if !TWIN_FREE
    double said[TWIN_SAID] = {frequency, 0.0, loss, 0.0};
#endif
    w->wander = draw_wander(w, span);
#if TWIN_FREE /* the wave turns with all that feigns a rate, noise too */
    const double command = radians(in->given[IN_PRECESSION] ? in->value[IN_PRECESSION] : p[P_loop_self_precession_deg_per_s]);
    const double since = w->rates && w->row_time >= 0 ? w->applied : applied; /* since the last row */
    double mean[TWIN_SAID];
    twin_turn_freely(w, (TwinTurning){frequency, PI * frequency * loss, felt / DEG_PER_H, {0, 0}, {{0, 0}}}, wave, applied, command, span, mean);
    mean[1] = (mean[1] - since) * DEG_PER_H;
    w->said[1] = (w->said[1] - applied) * DEG_PER_H;
    out[OUT_pattern_angle_deg] = w->azimuth * 180 / PI;
#elif TWIN_LOOPS
    const double angle = azimuth_of(w, in);
    twin_settle_loops(w, frequency, loss, wave, applied, angle, said);
    said[1] = felt + (said[1] - applied) * DEG_PER_H;
    out[OUT_pattern_angle_deg] = angle / PI * 180;
#else
    const double across = 2 * HARMONIC * azimuth_of(w, in); /* D(1/tau) sin 2n(theta - axis) over 2 n k */
    said[1] = felt + DEG_PER_H * PI * frequency * (wave[0] * sin(across) - wave[1] * cos(across)) / (2 * HARMONIC * TWIN_BRYAN);
#endif
    out[OUT_housing_temperature_degC] = housing - ZERO;
    out[OUT_resonator_temperature_degC] = T - ZERO;
    w->applied = applied;
#if TWIN_FREE
    say(w, mean, span);
#else
    say(w, said, span);
#endif
    w->row_time = w->time;
    return NULL;
}
