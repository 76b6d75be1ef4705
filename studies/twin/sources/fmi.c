/* The virtual gyro as an FMU for co-simulation, FMI 2.0 or 3.0 (TWIN_FMI); the declarations follow the standards' text.
 *
 * Value references: 0 time; outputs from 100, inputs from 200, parameters from 1000; 2 seed, 3 noise. Inputs are held over a
 * step, the boundary's temperature goes on with its slope. The gyro settles at the temperature that it has at the start.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "twin.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR };
enum { REF_SEED = 2, REF_NOISE = 3, REF_OUT = 100, REF_USE = 199, REF_IN = 200, REF_PARAMETER = 1000 };
enum { INPUTS = 2 + TWIN_COMMANDS }; /* temperature of the boundary, its slope, commands */

typedef unsigned int Reference;
typedef struct {
    Twin twin;
    double in[INPUTS];
    int32_t seed;
    int running;
    void *environment, (*log)(void);
    char *name;
} Instance;

static void say(Instance *instance, const char *message);

static const double starts[INPUTS] = TWIN_INPUT_STARTS;

static void clear(Instance *one) {
    twin_defaults(&one->twin);
    one->twin.noise = 1;
    memcpy(one->in, starts, sizeof starts);
    one->seed = one->running = 0;
}

static int check(Instance *one, const char *fault) {
    if (fault) say(one, fault);
    return fault ? ERROR : OK;
}

static TwinInput commands(const Instance *one) {
    TwinInput in;
    for (int k = 0; k < TWIN_COMMANDS; ++k) {
        in.value[k] = one->in[2 + k];
        in.given[k] = k != (TWIN_FREE ? IN_ANGLE : IN_PRECESSION);
    }
    return in;
}

static int begin(Instance *one) {
    const TwinInput in = commands(one);
    twin_seed(&one->twin, (uint64_t)one->seed);
    one->running = 1;
    const char *fault = twin_settle(&one->twin, one->in[0] + 273.15);
    return check(one, fault ? fault : twin_row(&one->twin, &in));
}

static int step(Instance *one, double h) {
    const TwinInput in = commands(one);
    const double from = one->in[0] + 273.15;
    if (!(h >= 0)) return check(one, "a step must not go back.");
    if (h == 0) return OK;
    const char *fault = twin_heat(&one->twin, h, from, from + one->in[1] * h);
    return check(one, fault ? fault : twin_row(&one->twin, &in));
}

static double *place(Instance *one, Reference r) {
    if (r >= REF_PARAMETER && r < REF_PARAMETER + TWIN_PARAMETERS) return &one->twin.p[r - REF_PARAMETER];
    if (r >= REF_IN && r < REF_IN + INPUTS) return &one->in[r - REF_IN];
    if (r >= REF_OUT && r < REF_OUT + TWIN_OUTPUTS) return &one->twin.out[r - REF_OUT];
    return r == REF_USE ? &one->twin.actuator_use : r == 0 ? &one->twin.time : NULL;
}

static int get(void *c, const Reference r[], size_t n, double values[]) {
    for (size_t k = 0; k < n; ++k) {
        const double *found = place(c, r[k]);
        if (!found) return check(c, "an unknown value reference.");
        values[k] = *found;
    }
    return OK;
}

static int set(void *c, const Reference r[], size_t n, const double values[]) {
    Instance *one = c;
    for (size_t k = 0; k < n; ++k) {
        double *found = place(one, r[k]);
        if (!found || r[k] < REF_IN) return check(one, "this variable cannot be set.");
        if (r[k] >= REF_PARAMETER && one->running) return check(one, "parameters are set before the initialization ends.");
        *found = values[k];
    }
    return OK;
}

static void *create(const char *name, const char *token, void *environment, void (*log)(void)) {
    Instance *one = token && !strcmp(token, TWIN_TOKEN) ? calloc(1, sizeof *one) : NULL;
    if (!one) return NULL;
    one->name = calloc(strlen(name ? name : "") + 1, 1);
    if (one->name && name) strcpy(one->name, name);
    one->environment = environment;
    one->log = log;
    clear(one);
    return one;
}

static void destroy(void *c) {
    if (c) free(((Instance *)c)->name);
    free(c);
}

static int reset(void *c) { return clear(c), OK; }

/* A state is a copy of the twin and its inputs; the name and the log stay. */
static int save(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Instance));
    if (!*state) return ERROR;
    memcpy(*state, c, sizeof(Instance));
    return OK;
}

static int restore(void *c, const void *state) {
    Instance *one = c;
    void *environment = one->environment, (*log)(void) = one->log;
    char *name = one->name;
    memcpy(one, state, sizeof *one);
    one->environment = environment;
    one->log = log;
    one->name = name;
    return OK;
}

static int drop(void **state) { return free(*state), *state = NULL, OK; }

static int get_integer(void *c, const Reference r[], size_t n, int32_t v[]) {
    for (size_t k = 0; k < n; ++k) {
        if (r[k] != REF_SEED) return check(c, "an unknown value reference.");
        v[k] = ((Instance *)c)->seed;
    }
    return OK;
}

static int set_integer(void *c, const Reference r[], size_t n, const int32_t v[]) {
    for (size_t k = 0; k < n; ++k) {
        if (r[k] != REF_SEED) return check(c, "this variable cannot be set.");
        ((Instance *)c)->seed = v[k];
    }
    return OK;
}

#define FLAGS(Flag)                                                                        \
    static int get_flag(void *c, const Reference r[], size_t n, Flag v[]) {                \
        for (size_t k = 0; k < n; ++k) {                                                   \
            if (r[k] != REF_NOISE) return check(c, "an unknown value reference.");         \
            v[k] = ((Instance *)c)->twin.noise;                                            \
        }                                                                                  \
        return OK;                                                                         \
    }                                                                                      \
    static int set_flag(void *c, const Reference r[], size_t n, const Flag v[]) {          \
        for (size_t k = 0; k < n; ++k) {                                                   \
            if (r[k] != REF_NOISE) return check(c, "this variable cannot be set.");        \
            ((Instance *)c)->twin.noise = v[k] != 0;                                       \
        }                                                                                  \
        return OK;                                                                         \
    }

#if TWIN_FMI == 2
#include "fmi2.inc"
#else
#include "fmi3.inc"
#endif
