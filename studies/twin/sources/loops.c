/* Loops of a force-to-rebalance gyro, settled: exact in the errors of pick-offs and drives. */
#include <math.h>

#include "twin.h"

#if TWIN_LOOPS
static const double PI = 3.14159265358979323846, HARMONIC = 2.0;

typedef struct { double re, im; } Complex;

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

/* Settled force to rebalance: C_d (a, r + iq) - i nu m = -A m with C_p m = (1, 0); a stiffness acts as iq (m2, m1).
 * `said`: frequency (Hz), rate (rad/s), 1/Q, held quadrature (1/s). */
void twin_settle_loops(Twin *w, double frequency, double loss, const double *wave, double rate, double angle, double *said) {
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
    double matrix[16], right[4];
    for (int i = 0; i < 2; ++i) {
        const Complex nulling = TWIN_STIFF ? m[1 - i] : D[i][1];
        const Complex columns[4] = {D[i][0], D[i][1], {-nulling.im, nulling.re}, {m[i].im, -m[i].re}};
        const Complex needed = times(minus, plus(times(A[i][0], m[0]), times(A[i][1], m[1])));
        for (int k = 0; k < 4; ++k) {
            matrix[i * 4 + k] = columns[k].re;
            matrix[(i + 2) * 4 + k] = columns[k].im;
        }
        right[i] = needed.re;
        right[i + 2] = needed.im;
    }
    twin_solve(4, matrix, right);
    const double force = coupling * radians(p[P_loop_rate_range_deg_per_s]);
    const double held = TWIN_STIFF ? PI * p[P_loop_quadrature_range_Hz] : force;
    const double used = fabs(right[1]) / force, nulled = fabs(right[2]) / held;
    const double most = p[P_loop_drive_headroom] * PI * TWIN_REFERENCE_FREQUENCY * p[P_loss_inverse_q];
    w->actuator_use = fmax(fmax(TWIN_STIFF ? used : hypot(used, nulled), nulled), fabs(right[0]) / most);
    said[0] = (omega + right[3]) / (2 * PI);
    said[1] = -right[1] / coupling;
    said[2] = 2 * right[0] / (omega + right[3]);
    said[3] = right[2];
}
#endif
