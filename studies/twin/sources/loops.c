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

typedef struct { double decay; Complex damped, detuned; } Wave; /* 1/tau, D(1/tau)/2 e^(2 i n axis), Dw/2 e^(2 i n axis); 1/s */

/* G = e^(i phi) diag(gx e^(i eta/2), gy e^(-i eta/2)) ((cos, sin), (sin, cos))(kappa/2) R(-n beta), in the frame of the azimuth; of drives, its transpose. */
static void channels(double ratio, double difference, double skew, double phase, double turned, double angle, Complex G[2][2]) {
    const double uneven = ratio / (2 + ratio), larger = 1 + uneven, less = 1 - uneven, c = cos(skew / 2), s = sin(skew / 2);
    const Complex gain[2] = {{larger * cos(phase + difference / 2), larger * sin(phase + difference / 2)},
                             {less * cos(phase - difference / 2), less * sin(phase - difference / 2)}};
    const double a = HARMONIC * angle, b = HARMONIC * (angle - turned), axes[2][2] = {{c, s}, {s, c}};
    const double left[2][2] = {{cos(a), sin(a)}, {-sin(a), cos(a)}}, right[2][2] = {{cos(b), -sin(b)}, {sin(b), cos(b)}};
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) {
            G[i][j] = (Complex){0, 0};
            for (int k = 0; k < 2; ++k) {
                const double part = left[i][k] * (axes[k][0] * right[0][j] + axes[k][1] * right[1][j]);
                G[i][j] = plus(G[i][j], (Complex){gain[k].re * part, gain[k].im * part});
            }
        }
}

static void pickoffs(const double *p, double angle, Complex P[2][2]) {
    channels(p[P_loop_pickoff_gain_ratio], radians(p[P_loop_pickoff_phase_difference_deg]), 1e-3 * p[P_loop_pickoff_skew_mrad],
             radians(p[P_loop_pickoff_phase_deg]), 0.0, angle, P);
}

/* The wave at a temperature; `wave`: anisotropy of 1/Q with its axis. */
static Wave wave_of(const double *p, double frequency, double loss, const double *wave) {
    const double own = PI * 1e-3 * p[P_loop_frequency_split_mHz], axis = 2 * HARMONIC * radians(p[P_loop_frequency_axis_deg]);
    return (Wave){PI * frequency * loss, {PI * frequency * wave[0] / 2, PI * frequency * wave[1] / 2},
                  {own * cos(axis) + PI * TWIN_SPLIT_RE, own * sin(axis) + PI * TWIN_SPLIT_IM}};
}

/* Settled loops: C_d (a, r + iq) - i nu m = n turn C_p^-1 (0, 1) - A m with C_p m = (1, 0); a stiffness acts as iq (m2, m1).
 * `found`: a, r of a wave that is held or n turn (rad/s) of one that turns freely at n `command` = r, q, and nu (1/s). */
static void settle(const double *p, const Wave *wave, double rate, double angle, double command, double *found) {
    const double coriolis = HARMONIC * TWIN_BRYAN * rate;
    Complex P[2][2], D[2][2], A[2][2], m[2];
    pickoffs(p, angle, P);
    channels(p[P_loop_drive_gain_ratio], radians(p[P_loop_drive_phase_difference_deg]), 1e-3 * p[P_loop_drive_skew_mrad],
             radians(p[P_loop_drive_phase_deg]), 1e-3 * p[P_loop_misalignment_mrad], angle, D);
    const Complex turn = {cos(2 * HARMONIC * angle), -sin(2 * HARMONIC * angle)};
    const Complex damped = times(wave->damped, turn), detuned = times(wave->detuned, turn);
    const Complex along = {-damped.re, detuned.re}, across = {-damped.im, detuned.im};
    A[0][0] = (Complex){along.re - wave->decay, along.im};
    A[1][1] = (Complex){-along.re - wave->decay, -along.im};
    A[0][1] = (Complex){across.re - coriolis, across.im};
    A[1][0] = (Complex){across.re + coriolis, across.im};
    const Complex minus = {-1, 0}, determinant = plus(times(P[0][0], P[1][1]), times(minus, times(P[0][1], P[1][0])));
    m[0] = over(P[1][1], determinant);
    m[1] = over(times(minus, P[1][0]), determinant);
    const Complex turning[2] = {over(P[0][1], determinant), over(times(minus, P[0][0]), determinant)}; /* -C_p^-1 (0, 1) */
    double matrix[16];
    for (int i = 0; i < 2; ++i) {
        const Complex nulling = TWIN_STIFF ? m[1 - i] : D[1][i], forced = times((Complex){HARMONIC * command, 0}, D[1][i]);
        const Complex columns[4] = {D[0][i], TWIN_FREE ? turning[i] : D[1][i], {-nulling.im, nulling.re}, {m[i].im, -m[i].re}};
        const Complex needed = times(minus, plus(forced, plus(times(A[i][0], m[0]), times(A[i][1], m[1]))));
        for (int k = 0; k < 4; ++k) {
            matrix[i * 4 + k] = columns[k].re;
            matrix[(i + 2) * 4 + k] = columns[k].im;
        }
        found[i] = needed.re;
        found[i + 2] = needed.im;
    }
    twin_solve(4, matrix, found);
}

/* `said`: frequency (Hz), rate (rad/s), 1/Q, held quadrature (1/s). */
static void tell(double frequency, double rate, const double *found, double *said) {
    said[0] = frequency + found[3] / (2 * PI);
    said[1] = rate;
    said[2] = found[0] / (PI * said[0]);
    said[3] = found[2];
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
    const Wave here = wave_of(w->p, frequency, loss, wave);
    double found[4];
    settle(w->p, &here, rate, angle, 0.0, found);
    tell(frequency, -found[1] / (HARMONIC * TWIN_BRYAN), found, said);
    w->actuator_use = use_of(w->p, fabs(found[1]) + HARMONIC * TWIN_BRYAN * radians(w->peak), found[2], found[0]);
}
#else
enum { AZIMUTHS = 2 * TWIN_TERMS, MOST_ROUNDS = 60 };
static const double LARGEST_TURN = 0.3, STILL = 1e-3, SETTLED = 1e-14;

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

/* What departs from the turn by rate and command alone, of each that it is linear in: 1/tau, parts of damped and detuned, k rate, command. */
static void see_channels(Twin *w) {
    const double *p = w->p;
    double values[TWIN_TURNERS][AZIMUTHS], found[4];
    for (int i = 0; i < TWIN_TURNERS; ++i) {
        const Wave one = {i == 0, {i == 1, i == 2}, {i == 3, i == 4}};
        for (int k = 0; k < AZIMUTHS; ++k) {
            settle(p, &one, (i == 5) / TWIN_BRYAN, PI * k / AZIMUTHS / HARMONIC, i == 6, found);
            values[i][k] = found[1] / HARMONIC - (i >= 5);
        }
        terms(values[i], w->turned[i]);
    }
    Complex P[2][2];
    const double start = radians(p[P_bias_pattern_angle_deg]), phase = radians(p[P_loop_pickoff_phase_deg]);
    pickoffs(p, start, P);
    const Complex in_phase = {cos(phase), -sin(phase)};
    w->azimuth = start + atan2(times(P[1][0], in_phase).re, times(P[0][0], in_phase).re) / HARMONIC;
}

/* A straight piece of the way from one row to the next: parts of it at its ends, rates (rad/s) there, what is commanded and what noise turns (rad/s). */
typedef struct { double from, to, seconds, first, last, command, noise; } Piece;

static double rate_at(const Piece *one, double part) { return one->first + (one->last - one->first) * part; }

/* What the loops say at an azimuth and a part of the way: 1/tau of the drive in the place of 1/Q. */
static void say_between(const Twin *w, const TwinTurning *a, const TwinTurning *b, double part, double rate, double azimuth, double command, double *said) {
    const double frequency = a->frequency + (b->frequency - a->frequency) * part;
    Wave here = wave_of(w->p, 0.0, 0.0, (const double[2]){0, 0});
    here.decay = a->decay + (b->decay - a->decay) * part;
    here.damped = (Complex){a->damped.re + (b->damped.re - a->damped.re) * part, a->damped.im + (b->damped.im - a->damped.im) * part};
    double found[4];
    settle(w->p, &here, rate, azimuth, command, found);
    tell(frequency, (found[1] / HARMONIC - command) / TWIN_BRYAN, found, said);
    said[2] = found[0];
}

/* What departs from the turn that rate and command would make alone, at a part of a piece. */
static double stray(const Twin *w, const TwinTurning *a, const TwinTurning *b, const Piece *one, double part, double azimuth) {
    const Complex e = {cos(2 * HARMONIC * azimuth), sin(2 * HARMONIC * azimuth)};
    const double way = one->from + (one->to - one->from) * part;
    const double feigned = series(a->drift, e) * (1 - way) + series(b->drift, e) * way;
    return feigned + TWIN_BRYAN * series(w->turned[5], e) * rate_at(one, part) + series(w->turned[6], e) * one->command;
}

static double drifting(const TwinTurning *row) {
    double speed = 0.0;
    for (int j = 0; j < TWIN_TERMS; ++j) speed += hypot(row->drift[j].re, row->drift[j].im);
    return speed;
}

/* Along a piece in steps of Simpson collocation, x_m = x + h/24 (5 x. + 8 x_m. - x'.), x' = x + h/6 (x. + 4 x_m. + x'.); `sums` gathers
 * what the loops say at two Gauss nodes of each step, or in the middle of one that hardly turns, times seconds. */
static void turn(Twin *w, const TwinTurning *a, const TwinTurning *b, const Piece *one, double *sums) {
    const double known = TWIN_BRYAN * fmax(fabs(one->first), fabs(one->last)) + fabs(one->command);
    const double size = 2 * HARMONIC * (known + fmax(drifting(a), drifting(b))) * one->seconds;
    const double pieces = fmax(ceil(size / LARGEST_TURN), 1.0), h = one->seconds / pieces;
    for (double k = 0; k < pieces; ++k) {
        const double from = k / pieces, middle = (k + 0.5) / pieces, to = (k + 1) / pieces, start = w->azimuth;
        const double speed = one->command + TWIN_BRYAN * rate_at(one, from) + one->noise, more = TWIN_BRYAN * (rate_at(one, to) - rate_at(one, from));
        const double half = h / 2 * (speed + more / 4), whole = h * (speed + more / 2), first = stray(w, a, b, one, from, start);
        double half_way = 0.0, there = 0.0, moved = 1.0, at_middle = first, last = first;
        for (int round = 0; round < MOST_ROUNDS && moved > SETTLED; ++round) {
            const double before = there;
            at_middle = stray(w, a, b, one, middle, start + half + half_way);
            last = stray(w, a, b, one, to, start + whole + there);
            half_way = h / 24 * (5 * first + 8 * at_middle - last);
            there = h / 6 * (first + 4 * at_middle + last);
            moved = fabs(there - before);
        }
        const int nodes = size / pieces < STILL ? 1 : 2;
        for (int node = 0; node < nodes; ++node) {
            const double c = 0.5 + (nodes - 1) * (node - 0.5) / sqrt(3), part = from + (to - from) * c;
            const double bend = first * (1 - 1.5 * c + 2 * c * c / 3) + at_middle * (2 * c - 4 * c * c / 3) + last * (2 * c * c / 3 - c / 2);
            const double azimuth = start + h * c * (speed + c / 2 * more + bend);
            double said[TWIN_SAID];
            say_between(w, a, b, one->from + (one->to - one->from) * part, rate_at(one, part), azimuth, one->command, said);
            for (int i = 0; i < TWIN_SAID; ++i) sums[i] += said[i] * h / nodes;
        }
        w->azimuth = start + whole + there;
    }
}

/* Whole angle: what has turned the azimuth since the last row, `mean` of what the loops said meanwhile, and in the twin what they say now. `applied` and
 * `command` (rad/s) act since then; where the course of the rate is known, that acts and `applied` is what does now. */
void twin_turn_freely(Twin *w, TwinTurning now, const double *wave, double applied, double command, double span, double *mean) {
    const Wave here = wave_of(w->p, now.frequency, now.decay / (PI * now.frequency), wave);
    const double sizes[5] = {here.decay, here.damped.re, here.damped.im, here.detuned.re, here.detuned.im};
    const TwinTurning before = w->turning;
    double sums[TWIN_SAID] = {0};
    if (w->row_time < 0) see_channels(w);
    now.damped = here.damped;
    for (int i = 0; i < 5; ++i)
        for (int j = 0; j < TWIN_TERMS; ++j) now.drift[j] = plus(now.drift[j], times((Complex){sizes[i], 0}, w->turned[i][j]));
    for (double from = w->row_time, until; w->row_time >= 0 && from < w->time; from = until) {
        double last = applied * 180 / PI;
        until = w->time;
        const double first = w->rates ? w->rates(w->course, from, &until, &last) : last;
        Piece one = {(from - w->row_time) / span, (until - w->row_time) / span, until - from, radians(first), radians(last), command,
                     TWIN_BRYAN * radians(w->wander / 3600)};
        one.first += before.rate + (now.rate - before.rate) * one.from;
        one.last += before.rate + (now.rate - before.rate) * one.to;
        turn(w, &before, &now, &one, sums);
    }
    w->turning = now;
    say_between(w, &now, &now, 0.0, now.rate + applied, w->azimuth, command, w->said);
    for (int i = 0; i < TWIN_SAID; ++i) mean[i] = w->row_time < 0 ? w->said[i] : sums[i] / span;
    w->actuator_use = use_of(w->p, HARMONIC * command, hypot(here.detuned.re, here.detuned.im), mean[2]);
    mean[2] /= PI * mean[0];
    w->said[2] /= PI * w->said[0];
}
#endif
#endif
