/* The heat path: C(T) dT/dt = q - (L T + sigma R T^4), advanced in the modes of the linearised network.
 *
 * What is not linear is a parabola in time over each step, found by iteration; the linear part and the boundary's straight
 * line are exact: x(t) = sum over k of u_k k! t^(k+1) phi_(k+1)(-rate t) for a power u0 + u1 t + u2 t^2, x the departure.
 */
#include <math.h>
#include <string.h>

#include "twin.h"

#define STEFAN_BOLTZMANN TWIN_STEFAN_BOLTZMANN
enum { N = TWIN_NODES, MOST_ITERATIONS = 50 };
static const double LONGEST = 5.0, TOLERANCE = 1e-10; /* s, K */

double twin_spline(const TwinSpline *s, double x, double *slope) {
    int k = (int)((x - s->first) / s->step);
    k = k < 0 ? 0 : k > s->count - 1 ? s->count - 1 : k;
    const double d = x - (s->first + k * s->step), *c = s->coefficients + k;
    const int m = s->count;
    if (slope) *slope = (3 * c[0] * d + 2 * c[m]) * d + c[2 * m];
    return ((c[0] * d + c[m]) * d + c[2 * m]) * d + c[3 * m];
}

static double capacity(const Twin *w, int i, double T) {
    const TwinCapacity *own = twin_capacities + i;
    if (own->parameter == P_thermal_heat_capacity_J_per_kg_K && twin_heat_capacity.count)
        return own->factor * twin_spline(&twin_heat_capacity, T, NULL);
    return own->factor * w->p[own->parameter] * (own->slope != 0 ? exp(own->slope * (T - TWIN_AROUND)) : 1);
}

static double node(const double *T, double boundary, int i) { return i < N ? T[i] : boundary; }

/* Heat (W) into the nodes; with `linear`, radiation is that about that temperature. */
static void inflow(const Twin *w, const double *T, double boundary, double linear, double *heat) {
    memcpy(heat, w->power, sizeof w->power);
    for (int part = 0; part < 2; ++part) {
        const TwinLink *links = part ? twin_radiators : twin_links;
        const int count = part ? TWIN_RADIATORS : TWIN_LINKS;
        for (int k = 0; k < count; ++k) {
            const double a = node(T, boundary, links[k].one), b = node(T, boundary, links[k].other);
            double flow = part ? w->area[k] * STEFAN_BOLTZMANN : w->conductance[k];
            flow *= !part ? b - a : linear > 0 ? 4 * pow(linear, 3) * (b - a) : (b * b - a * a) * (b * b + a * a);
            if (links[k].one < N) heat[links[k].one] += flow;
            if (links[k].other < N) heat[links[k].other] -= flow;
        }
    }
}

static double linear_at(void) { return TWIN_LINEAR ? TWIN_REFERENCE : 0.0; }

/* Slope of the heat flowing out by the temperatures: L + 4 sigma R T^3. */
static void slope_of_outflow(const Twin *w, const double *T, double boundary, double linear, double *matrix) {
    memset(matrix, 0, sizeof(double) * N * N);
    for (int part = 0; part < 2; ++part) {
        const TwinLink *links = part ? twin_radiators : twin_links;
        const int count = part ? TWIN_RADIATORS : TWIN_LINKS;
        for (int k = 0; k < count; ++k) {
            const int ends[2] = {links[k].one, links[k].other};
            for (int e = 0; e < 2; ++e) {
                const double at_end = linear > 0 ? linear : node(T, boundary, ends[e]);
                const double g = part ? 4 * STEFAN_BOLTZMANN * w->area[k] * pow(at_end, 3) : w->conductance[k];
                if (ends[e] >= N) continue;
                matrix[ends[e] * N + ends[e]] += g;
                if (ends[1 - e] < N) matrix[ends[1 - e] * N + ends[e]] -= g;
            }
        }
    }
}

static void build(Twin *w) {
    const double *p = w->p;
    for (int k = 0; k < TWIN_LINKS; ++k) {
        const TwinLink *one = &twin_links[k];
        w->conductance[k] = one->factor * (one->parameter < 0 ? 0.0 : p[one->parameter]);
    }
    if (TWIN_SENSOR >= 0) /* it takes hardly any heat, with its time constant */
        w->conductance[TWIN_LINKS - 1] = TWIN_SENSOR_SHARE * p[P_thermal_housing_heat_capacity_J_per_K]
                                         / fmax(p[P_noise_housing_lag_s], TWIN_LEAST_LAG);
    for (int k = 0; k < TWIN_RADIATORS; ++k) w->area[k] = twin_radiators[k].factor * p[twin_radiators[k].parameter];
    for (int i = 0; i < N; ++i) w->power[i] = 1e-3 * p[P_thermal_drive_power_mW] * twin_power_shares[i];
}

const char *twin_settle(Twin *w, double boundary) {
    static const int steps = 50;
    double heat[N];
    for (int k = 0; k < TWIN_PARAMETERS; ++k)
        if (!(w->p[k] >= twin_limits[k][0] && w->p[k] <= twin_limits[k][1])) return "a parameter is not what a card allows; its min and max are in the model description.";
    build(w);
    w->boundary = boundary;
    w->time = 0.0;
    w->row_time = -1.0;
    w->length = w->last_change = w->trend = 0.0;
    w->pasts = 0;
    w->of_frequency.begun = w->of_bias.begun = 0;
    for (int i = 0; i < N; ++i) w->T[i] = boundary;
    for (int k = 0;; ++k) {
        double most = 0.0;
        inflow(w, w->T, boundary, linear_at(), heat);
        slope_of_outflow(w, w->T, boundary, linear_at(), &w->shape[0][0]);
        if (k == steps || !twin_solve(N, &w->shape[0][0], heat))
            return "no steady state was found: check the conductances and the power of [thermal].";
        for (int i = 0; i < N; ++i) {
            w->T[i] = fmax(w->T[i] + heat[i], 0.1 * w->T[i]);
            most = fmax(most, fabs(heat[i]));
        }
        if (most < 1e-9 * boundary) break;
    }
    slope_of_outflow(w, w->T, boundary, boundary, &w->shape[0][0]);
    for (int i = 0; i < N; ++i) w->capacity[i] = capacity(w, i, boundary);
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) w->shape[i][j] /= sqrt(w->capacity[i] * w->capacity[j]);
    twin_modes(N, &w->shape[0][0], w->scratch);
    for (int m = 0; m < N; ++m) w->rate[m] = w->shape[m][m];
    for (int i = 0; i < N; ++i)
        for (int m = 0; m < N; ++m) w->shape[i][m] = w->scratch[i * N + m] / sqrt(w->capacity[i]);
    return NULL;
}

/* t phi_1, t^2 phi_2 and 2 t^3 phi_3 of -z, z = rate t, of half a step and of a whole one. */
static void weigh(Twin *w, double h) {
    for (int part = 0; part < 2; ++part)
        for (int m = 0; m < N; ++m) {
            const double t = part ? h : h / 2, z = w->rate[m] * t;
            double phi[4] = {exp(-z), 0, 0, 0};
            if (z > 1) {
                phi[1] = (1 - phi[0]) / z;
                phi[2] = (1 - phi[1]) / z;
                phi[3] = (0.5 - phi[2]) / z;
            } else
                for (int k = 1; k < 4; ++k) {
                    double term = k == 1 ? 1.0 : k == 2 ? 0.5 : 1.0 / 6;
                    for (int j = k + 1; j < k + 20; ++j, term *= -z / (j - 1)) phi[k] += term;
                }
            const double weights[3] = {t * phi[1], t * t * phi[2], 2 * t * t * t * phi[3]};
            for (int k = 0; k < 3; ++k) w->weight[part][k][m] = weights[k];
        }
    w->length = h;
}

/* What drives the modes of the departure from T0: the heat at temperatures T, and what the modes' own decay takes of it. */
static void drive(const Twin *w, const double *T, double boundary, double *u) {
    double heat[N];
    inflow(w, T, boundary, linear_at(), heat);
    for (int i = 0; i < N; ++i) heat[i] *= w->capacity[i] / capacity(w, i, T[i]);
    for (int m = 0; m < N; ++m) {
        double power = 0.0, departed = 0.0;
        for (int i = 0; i < N; ++i) {
            power += w->shape[i][m] * heat[i];
            departed += w->shape[i][m] * w->capacity[i] * (T[i] - w->T[i]);
        }
        u[m] = power + w->rate[m] * departed;
    }
}

static const char *advance(Twin *w, double h, double from, double to) {
    double u[3][N], T[3][N];
    if (h != w->length) weigh(w, h);
    for (int k = 0; k < 3; ++k) memcpy(T[k], w->T, sizeof w->T);
    for (int k = 0; k < MOST_ITERATIONS; ++k) {
        double change = 0.0;
        for (int moment = k ? 1 : 0; moment < 3; ++moment) drive(w, T[moment], from + (to - from) * moment / 2, u[moment]);
        for (int part = 0; part < 2; ++part) {
            double *found = T[part + 1], y[N];
            double(*weight)[N] = w->weight[part];
            for (int m = 0; m < N; ++m) {
                const double slope = (4 * u[1][m] - 3 * u[0][m] - u[2][m]) / h;
                const double bend = 2 * (u[0][m] - 2 * u[1][m] + u[2][m]) / (h * h);
                y[m] = weight[0][m] * u[0][m] + weight[1][m] * slope + weight[2][m] * bend;
            }
            for (int i = 0; i < N; ++i) {
                double sum = w->T[i];
                for (int m = 0; m < N; ++m) sum += w->shape[i][m] * y[m];
                change = fmax(change, fabs(sum - found[i]));
                found[i] = sum;
            }
        }
        if (change < TOLERANCE) {
            memcpy(w->T, T[2], sizeof w->T);
            return NULL;
        }
        if (!(change < 1e4)) break;
    }
    return "the radiation is too strong for a step of the heat path; shorten the time between rows.";
}

const char *twin_heat(Twin *w, double h, double from, double to) {
    const int steps = (int)fmax(1.0, ceil(h / LONGEST - 1e-9));
    for (int k = 0; k < steps; ++k) {
        const char *fault = advance(w, h / steps, from + (to - from) * k / steps, from + (to - from) * (k + 1) / steps);
        if (fault) return fault;
    }
    w->time += h;
    w->boundary = to;
    w->trend = (to - from) / h;
    return NULL;
}

void twin_warming(const Twin *w, double *rate) {
    inflow(w, w->T, w->boundary, linear_at(), rate);
    for (int i = 0; i < N; ++i) rate[i] /= capacity(w, i, w->T[i]);
}

/* Solve by elimination with pivots; 0 where the matrix is singular. */
int twin_solve(int n, double *a, double *b) {
    for (int k = 0; k < n; ++k) {
        int pivot = k;
        for (int i = k + 1; i < n; ++i)
            if (fabs(a[i * n + k]) > fabs(a[pivot * n + k])) pivot = i;
        if (!(fabs(a[pivot * n + k]) > 0)) return 0;
        for (int j = 0; j < n; ++j) {
            const double kept = a[k * n + j];
            a[k * n + j] = a[pivot * n + j];
            a[pivot * n + j] = kept;
        }
        const double kept = b[k];
        b[k] = b[pivot];
        b[pivot] = kept;
        for (int i = k + 1; i < n; ++i) {
            const double f = a[i * n + k] / a[k * n + k];
            for (int j = k; j < n; ++j) a[i * n + j] -= f * a[k * n + j];
            b[i] -= f * b[k];
        }
    }
    for (int k = n - 1; k >= 0; --k) {
        for (int j = k + 1; j < n; ++j) b[k] -= a[k * n + j] * b[j];
        b[k] /= a[k * n + k];
    }
    return 1;
}

/* Jacobi's rotations: a symmetric matrix becomes diagonal, the columns of `v` its vectors. */
void twin_modes(int n, double *a, double *v) {
    for (int i = 0; i < n * n; ++i) v[i] = i % (n + 1) == 0;
    for (int sweep = 0; sweep < 60; ++sweep) {
        int turned = 0;
        for (int p = 0; p < n; ++p)
            for (int q = p + 1; q < n; ++q) {
                const double off = a[p * n + q];
                if (fabs(off) <= 1e-17 * sqrt(fabs(a[p * n + p] * a[q * n + q]))) continue;
                turned = 1;
                const double theta = (a[q * n + q] - a[p * n + p]) / (2 * off);
                const double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1));
                const double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int i = 0; i < n; ++i) {
                    const double x = a[i * n + p], y = a[i * n + q];
                    a[i * n + p] = c * x - s * y;
                    a[i * n + q] = s * x + c * y;
                }
                for (int i = 0; i < n; ++i) {
                    const double x = a[p * n + i], y = a[q * n + i];
                    a[p * n + i] = c * x - s * y;
                    a[q * n + i] = s * x + c * y;
                    const double f = v[i * n + p], g = v[i * n + q];
                    v[i * n + p] = c * f - s * g;
                    v[i * n + q] = s * f + c * g;
                }
                a[p * n + q] = a[q * n + p] = 0.0;
            }
        if (!turned) return;
    }
}
