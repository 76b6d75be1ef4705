/* Settled loops, exact in the errors of pick-offs and drives: of a wave that is held, and of one that turns freely. */
#include <math.h>

#include "twin.h"

#if TWIN_LOOPS
static const double PI = 3.14159265358979323846, HARMONIC = 2.0;

typedef TwinComplex Complex;

static Complex plus(Complex a, Complex b) { return (Complex){a.re + b.re, a.im + b.im}; }
static Complex times(Complex a, Complex b) { return (Complex){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
static Complex over(Complex a, Complex b) {
    const double size = b.re * b.re + b.im * b.im;
    return (Complex){(a.re * b.re + a.im * b.im) / size, (a.im * b.re - a.re * b.im) / size};
}

static double radians(double degrees) { return degrees * (PI / 180); }

/* G = R(n beta) [1 + ((delta + i eta, kappa), (kappa, -delta - i eta))/2] e^(i phi), seen in the frame of the azimuth. */
static void channels(double ratio, double difference, double skew, double phase, double turned, double angle, Complex G[2][2]) {
    const Complex e = {cos(phase), sin(phase)}, stretch[2][2] = {{{1 + ratio / 2, difference / 2}, {skew / 2, 0}},
                                                                  {{skew / 2, 0}, {1 - ratio / 2, -difference / 2}}};
    const double c = cos(HARMONIC * angle), s = sin(HARMONIC * angle), b = HARMONIC * turned - HARMONIC * angle;
    const double left[2][2] = {{cos(b), -sin(b)}, {sin(b), cos(b)}}, right[2][2] = {{c, -s}, {s, c}};
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) {
            Complex sum = {0, 0};
            for (int k = 0; k < 2; ++k)
                for (int l = 0; l < 2; ++l) {
                    const double f = left[i][k] * right[l][j];
                    sum = plus(sum, (Complex){stretch[k][l].re * f, stretch[k][l].im * f});
                }
            G[i][j] = times(sum, e);
        }
}

/* Settled loops: C_d (a, r + iq) - i nu m = n turn C_p^-1 (0, 1) - A m with C_p m = (1, 0); a stiffness acts as iq (m2, m1).
 * `turn` (rad/s) is what the command of the rate makes of the azimuth. `said`: frequency (Hz), rate (rad/s), 1/Q, held quadrature (1/s). */
static void settle(Twin *w, double frequency, double loss, const double *wave, double rate, double angle, double turned, double *said) {
    const double *p = w->p, omega = 2 * PI * frequency, decay = omega * loss / 2, coupling = HARMONIC * TWIN_BRYAN;
    Complex P[2][2], D[2][2], A[2][2], m[2];
    channels(p[P_loop_pickoff_gain_ratio], radians(p[P_loop_pickoff_phase_difference_deg]), 1e-3 * p[P_loop_pickoff_skew_mrad],
             radians(p[P_loop_pickoff_phase_deg]), 0.0, angle, P);
    channels(p[P_loop_drive_gain_ratio], radians(p[P_loop_drive_phase_difference_deg]), 1e-3 * p[P_loop_drive_skew_mrad],
             radians(p[P_loop_drive_phase_deg]), 1e-3 * p[P_loop_misalignment_mrad], angle, D);
    const double own = PI * 1e-3 * p[P_loop_frequency_split_mHz], axis = 2 * HARMONIC * radians(p[P_loop_frequency_axis_deg]);
    const Complex turn = {cos(2 * HARMONIC * angle), -sin(2 * HARMONIC * angle)};
    const Complex damped = times((Complex){omega * wave[0] / 4, omega * wave[1] / 4}, turn);
    const Complex detuned = times((Complex){own * cos(axis) + PI * TWIN_SPLIT_RE, own * sin(axis) + PI * TWIN_SPLIT_IM}, turn);
    const Complex along = {-damped.re, detuned.re}, across = {-damped.im, detuned.im};
    A[0][0] = (Complex){along.re - decay, along.im};
    A[1][1] = (Complex){-along.re - decay, -along.im};
    A[0][1] = (Complex){across.re - coupling * rate, across.im};
    A[1][0] = (Complex){across.re + coupling * rate, across.im};
    const Complex minus = {-1, 0}, determinant = plus(times(P[0][0], P[1][1]), times(minus, times(P[0][1], P[1][0])));
    m[0] = over(P[1][1], determinant);
    m[1] = over(times(minus, P[1][0]), determinant);
    const Complex across_of[2] = {over(times(minus, P[0][1]), determinant), over(P[0][0], determinant)};
    double matrix[16], right[4];
    for (int i = 0; i < 2; ++i) {
        const Complex nulling = TWIN_STIFF ? m[1 - i] : D[i][1];
        const Complex columns[4] = {D[i][0], D[i][1], {-nulling.im, nulling.re}, {m[i].im, -m[i].re}};
        const Complex moving = times((Complex){HARMONIC * turned, 0}, across_of[i]);
        const Complex needed = plus(moving, times(minus, plus(times(A[i][0], m[0]), times(A[i][1], m[1]))));
        for (int k = 0; k < 4; ++k) {
            matrix[i * 4 + k] = columns[k].re;
            matrix[(i + 2) * 4 + k] = columns[k].im;
        }
        right[i] = needed.re;
        right[i + 2] = needed.im;
    }
    twin_solve(4, matrix, right);
    said[0] = (omega + right[3]) / (2 * PI);
    said[1] = -right[1] / coupling;
    said[2] = 2 * right[0] / (omega + right[3]);
    said[3] = right[2];
}

/* The largest part of an actuator's range that commands across, of quadrature and along the wave (1/s) take. */
static double use_of(const double *p, double across, double quadrature, double along) {
    const double force = HARMONIC * TWIN_BRYAN * radians(p[P_loop_rate_range_deg_per_s]);
    const double used = fabs(across) / force, nulled = fabs(quadrature) / (TWIN_STIFF ? PI * p[P_loop_quadrature_range_Hz] : force);
    const double most = p[P_loop_drive_headroom] * PI * TWIN_REFERENCE_FREQUENCY * p[P_loss_inverse_q];
    return fmax(fmax(TWIN_STIFF ? used : hypot(used, nulled), nulled), fabs(along) / most);
}

#if !TWIN_FREE
void twin_settle_loops(Twin *w, double frequency, double loss, const double *wave, double rate, double angle, double *said) {
    settle(w, frequency, loss, wave, rate, angle, 0.0, said);
    w->actuator_use = use_of(w->p, HARMONIC * TWIN_BRYAN * said[1], said[3], PI * said[0] * said[2]);
}
#else
enum { AZIMUTHS = 16, MOST_ROUNDS = 60 };
static const double LARGEST_TURN = 0.3, SETTLED = 1e-14;

/* Terms c_0 ... of Re sum c_j e^(2 i j psi) through values at even psi in 0 ... pi; and the sum, by Horner's rule. */
static void terms(const double *values, Complex *c) {
    for (int j = 0; j < TWIN_TERMS; ++j) {
        c[j] = (Complex){0, 0};
        for (int k = 0; k < AZIMUTHS; ++k) {
            const double at = 2 * PI * j * k / AZIMUTHS, share = values[k] * (j ? 2.0 : 1.0) / AZIMUTHS;
            c[j] = plus(c[j], (Complex){share * cos(at), -share * sin(at)});
        }
    }
}

static double series(const Complex *c, Complex e) {
    Complex found = {0, 0};
    for (int j = TWIN_TERMS - 1; j >= 0; --j) found = plus(times(found, e), c[j]);
    return found.re;
}

/* How much of a turn the pick-offs show, g - 1, and of a force across the wave arrives through the drives, g c - 1. */
static void see_channels(Twin *w) {
    const double *p = w->p;
    Complex P[2][2], D[2][2];
    double g[AZIMUTHS], gc[AZIMUTHS];
    channels(p[P_loop_pickoff_gain_ratio], radians(p[P_loop_pickoff_phase_difference_deg]), 1e-3 * p[P_loop_pickoff_skew_mrad], 0.0, 0.0, 0.0, P);
    channels(p[P_loop_drive_gain_ratio], radians(p[P_loop_drive_phase_difference_deg]), 1e-3 * p[P_loop_drive_skew_mrad],
             radians(p[P_loop_drive_phase_deg] + p[P_loop_pickoff_phase_deg]), 1e-3 * p[P_loop_misalignment_mrad], 0.0, D);
    const double determinant = P[0][0].re * P[1][1].re - P[0][1].re * P[1][0].re;
    for (int k = 0; k < AZIMUTHS; ++k) {
        const double c = cos(PI * k / AZIMUTHS), s = sin(PI * k / AZIMUTHS);
        const double x = (P[1][1].re * c - P[0][1].re * s) / determinant, y = (P[0][0].re * s - P[1][0].re * c) / determinant;
        g[k] = determinant * (x * x + y * y) - 1;
        gc[k] = determinant * (x * (D[1][1].re * c - D[1][0].re * s) - y * (D[0][1].re * c - D[0][0].re * s)) - 1;
    }
    terms(g, w->shown);
    terms(gc, w->arriving);
    const double angle = HARMONIC * radians(p[P_bias_pattern_angle_deg]), x = P[0][0].re * cos(angle) + P[0][1].re * sin(angle);
    const double off = atan2(P[1][0].re * cos(angle) + P[1][1].re * sin(angle), x) - angle + PI;
    w->azimuth = (angle + off - 2 * PI * floor(off / (2 * PI)) - PI) / HARMONIC;
}

/* What departs from the turn that rate and command would make alone, at a part of the way from one row to the next. */
static double stray(const Twin *w, const TwinTurning *a, const TwinTurning *b, double part, double azimuth, double command) {
    const Complex e = {cos(2 * HARMONIC * azimuth), sin(2 * HARMONIC * azimuth)};
    const double g = series(w->shown, e), feigned = series(a->drift, e) * (1 - part) + series(b->drift, e) * part;
    return TWIN_BRYAN * ((1 + g) * feigned + g * (a->rate + (b->rate - a->rate) * part)) + series(w->arriving, e) * command;
}

static double fastest(const TwinTurning *row, double command) {
    double speed = fabs(TWIN_BRYAN * row->rate) + fabs(command);
    for (int j = 0; j < TWIN_TERMS; ++j) speed += TWIN_BRYAN * hypot(row->drift[j].re, row->drift[j].im);
    return 2 * HARMONIC * speed;
}

/* From one row to the next: Simpson collocation, x_m = x + h/24 (5 x. + 8 x_m. - x'.), x' = x + h/6 (x. + 4 x_m. + x'.). */
static void turn(Twin *w, const TwinTurning *a, const TwinTurning *b, double command, double span) {
    const double pieces = fmax(ceil(fmax(fastest(a, command), fastest(b, command)) * span / LARGEST_TURN), 1.0), h = span / pieces;
    for (double k = 0; k < pieces; ++k) {
        const double from = k / pieces, middle = (k + 0.5) / pieces, to = (k + 1) / pieces, start = w->azimuth;
        const double half = (command + TWIN_BRYAN * (a->rate + (b->rate - a->rate) * (k + 0.25) / pieces)) * h / 2;
        const double whole = (command + TWIN_BRYAN * (a->rate + (b->rate - a->rate) * middle)) * h;
        const double first = stray(w, a, b, from, start, command);
        double half_way = 0.0, there = 0.0, moved = 1.0;
        for (int round = 0; round < MOST_ROUNDS && moved > SETTLED; ++round) {
            const double at_middle = stray(w, a, b, middle, start + half + half_way, command);
            const double last = stray(w, a, b, to, start + whole + there, command), before = there;
            half_way = h / 24 * (5 * first + 8 * at_middle - last);
            there = h / 6 * (first + 4 * at_middle + last);
            moved = fabs(there - before);
        }
        w->azimuth = start + whole + there;
    }
}

/* Whole angle: what the rows before have made of the azimuth, and what the loops say there. `before` is the rate that acted when
 * the span since the last row began, `command` the commanded turn (rad/s) since then. */
void twin_turn_freely(Twin *w, double frequency, double loss, const double *wave, double before, double rate, double command, double span, double *said) {
    double held[AZIMUTHS], still[4], moving[4];
    TwinTurning now;
    for (int k = 0; k < AZIMUTHS; ++k) {
        settle(w, frequency, loss, wave, 0.0, PI * k / AZIMUTHS / HARMONIC, 0.0, still);
        held[k] = still[1];
    }
    now.rate = rate;
    terms(held, now.drift);
    if (w->row_time < 0) see_channels(w);
    else {
        w->turning.rate = before;
        turn(w, &w->turning, &now, command, span);
        w->azimuth += TWIN_BRYAN * radians(w->wander / 3600) * span;
    }
    w->turning = now;
    settle(w, frequency, loss, wave, rate, w->azimuth, 0.0, still);
    settle(w, frequency, loss, wave, rate, w->azimuth, 1.0, moving);
    const double turned = (-command / TWIN_BRYAN - still[1]) / (moving[1] - still[1]); /* the command is linear in the turn */
    settle(w, frequency, loss, wave, rate, w->azimuth, turned, said);
    said[1] += turned / TWIN_BRYAN;
    const double own = PI * 1e-3 * w->p[P_loop_frequency_split_mHz], axis = 2 * HARMONIC * radians(w->p[P_loop_frequency_axis_deg]);
    const double split = hypot(own * cos(axis) + PI * TWIN_SPLIT_RE, own * sin(axis) + PI * TWIN_SPLIT_IM);
    w->actuator_use = use_of(w->p, HARMONIC * command, split, PI * frequency * (loss + hypot(wave[0], wave[1]) / 2));
}
#endif
#endif
