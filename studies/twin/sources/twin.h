/* A virtual gyro: heat path, frequency, zero-rate output, 1/Q, effects, settled loops and noise, row by row.
 *
 * card.h and card.c hold the numbers of one card; everything else is the same for all. Temperatures are in kelvin inside,
 * in degC at inputs and outputs. A function that can fail returns NULL, or a sentence that says why.
 *
 *     twin_defaults(&twin);            the card's parameters; change twin.p[P_...] here, P_start_s among them: when the
 *                                      run begins, s since 1970 (UTC), from which effects with a date count on
 *     twin_settle(&twin, 293.15);      the steady state at this temperature of the boundary
 *     twin_row(&twin, &in);            the outputs twin.out[OUT_...] at this moment
 *     twin_heat(&twin, h, T0, T1);     h seconds on; the boundary goes from T0 to T1 (K) in a straight line
 */
#ifndef TWIN_H
#define TWIN_H

#include <stdint.h>

#include "card.h"

enum { IN_RATE, IN_AMPLITUDE, IN_VOLTAGE, IN_QUADRATURE, IN_ANGLE, IN_PRECESSION, TWIN_COMMANDS };
enum { TARGET_TEMPERATURE, TARGET_FREQUENCY, TARGET_BIAS, TARGET_LOSS, TARGETS };
enum { FLICKER_TIMES = 18, TWIN_TERMS = 16, TWIN_TURNERS = 7, TWIN_SAID = 4 };

typedef struct { int one, other, parameter; double factor; } TwinLink; /* conductance or exchange area = p * factor */
typedef struct { int parameter; double factor, slope; } TwinCapacity;  /* p * factor, slope (1/K) about 20 degC; of shell and stem over T */
typedef struct { int kind, target, memory, shape, weights; double since; } TwinEffect; /* places in the memory and, of shape and weights, in p; its date, s since 1970 */
typedef struct { double first, step; int count; const double *coefficients; } TwinSpline; /* 4 rows, highest power first */

/* deg/s, V, V, V, deg, deg/s; a command that is not given does not act; the azimuth, and the precession of a free wave, are the card's. */
typedef struct { double value[TWIN_COMMANDS]; int given[TWIN_COMMANDS]; } TwinInput;

typedef struct { double flicker[FLICKER_TIMES], walk, offset, markov; int begun; } TwinNoise;
typedef struct { double white, flicker, walk, offset, markov, markov_time; } TwinLevels;

typedef struct { double re, im; } TwinComplex;
/* At a row: Hz, 1/tau and D(1/tau)/2 with its axis (1/s), the rate that is feigned and the turn that azimuths feign (rad/s). */
typedef struct { double frequency, decay, rate; TwinComplex damped, drift[TWIN_TERMS]; } TwinTurning;

typedef struct Twin {
    double p[TWIN_PARAMETERS];
    double time, step, row_time; /* since the start; between rows; of the last row, below 0 before the first */
    double boundary, trend, T[TWIN_NODES]; /* of the boundary, K/s */
    double out[TWIN_OUTPUTS];
    double actuator_use; /* largest part of an actuator's range that the settled loops need; above 1 they cannot hold the wave */
    int noise;
    double capacity[TWIN_NODES], power[TWIN_NODES], area[TWIN_RADIATORS], conductance[TWIN_LINKS];
    double rate[TWIN_NODES], shape[TWIN_NODES][TWIN_NODES]; /* modes of the linearised network */
    double scratch[TWIN_NODES * TWIN_NODES];
    double length, weight[2][3][TWIN_NODES];                /* of the last step: t^k phi_k, half and whole */
    double memory[TWIN_MEMORY], last_change;
    double past[TWIN_PAST][3]; /* of a resonator that is late: times, temperatures and their rates, in turns */
    long pasts;
    uint64_t random[4];
    double spare;
    int has_spare;
    TwinNoise of_frequency, of_bias;
    double wander; /* noise of the zero-rate output since the last row, deg/h */
    /* Of a wave that turns freely: its measured azimuth (rad), what turns it, what its channels make of that; what was said of the
     * last row, and means since the one before. */
    double azimuth, said[TWIN_SAID], applied;
    TwinTurning turning;
    TwinComplex turned[TWIN_TURNERS][TWIN_TERMS];
    double peak; /* deg/s: by how much the applied rate exceeds its input, a mean, until the next row */
    /* the applied rate (deg/s) from a moment until it bends, and where it does; where it is not known the input has acted since the last row */
    double (*rates)(void *course, double from, double *until, double *last);
    void *course;
    /* heats by seconds along what the boundary will do, where that is known; else it goes straight on */
    const char *(*onward)(struct Twin *, const void *way, double seconds);
    const void *way;
} Twin;

extern const double twin_start[TWIN_PARAMETERS];
extern const double twin_limits[TWIN_PARAMETERS][2]; /* lowest and highest value that a card allows */
extern const char *const twin_parameter_names[TWIN_PARAMETERS]; /* as in the card; "" where there is no key */
extern const TwinLink twin_links[TWIN_LINKS], twin_radiators[TWIN_RADIATORS];
extern const TwinCapacity twin_capacities[TWIN_NODES];
extern const double twin_power_shares[TWIN_NODES];
extern const double twin_lags[TWIN_LAGS][3]; /* time constant, part of the housing, part of heat */
extern const double twin_rows[5][TWIN_NODES]; /* resonator, and what is uneven in it */
extern const double twin_uneven[4];
extern const TwinSpline twin_law, twin_heat_capacity, twin_loss, twin_wave[2];
extern const TwinEffect twin_effects[TWIN_EFFECTS];
extern const char *const twin_columns[TWIN_OUTPUTS];
extern const int twin_digits[TWIN_OUTPUTS];

void twin_defaults(Twin *twin);
void twin_seed(Twin *twin, uint64_t seed);
const char *twin_settle(Twin *twin, double boundary);
const char *twin_heat(Twin *twin, double h, double from, double to);
const char *twin_row(Twin *twin, const TwinInput *in);
#if TWIN_FREE
void twin_last_row(Twin *twin); /* the outputs at this moment itself: those of a free wave are means since the row before */
#endif

/* Of the parts. */
double twin_effect(Twin *twin, const TwinEffect *effect, const TwinInput *in, double h, double housing, double resonator, double rate);
#if TWIN_FREE
void twin_turn_freely(Twin *w, TwinTurning now, const double *wave, double applied, double command, double span, double *mean);
#elif TWIN_LOOPS
void twin_settle_loops(Twin *twin, double frequency, double loss, const double *wave, double rate, double angle, double *said);
#endif
void twin_warming(const Twin *twin, double *rate);
double twin_spline(const TwinSpline *spline, double x, double *slope);
double twin_normal(Twin *twin);
double twin_draw(Twin *twin, TwinNoise *noise, TwinLevels level, double span);
int twin_solve(int n, double *matrix, double *right);
void twin_modes(int n, double *matrix, double *vectors);

#endif
