/* An FMU from instantiation to its end: steps of several lengths, a state kept, spelled, read and taken up again, wrong references. */
#include <stdio.h>

#include "fmi.c"

#if TWIN_FMI == 2
#define DO_STEP(c, t, h) fmi2DoStep(c, t, h, 1)
#define CREATE() fmi2Instantiate("one", 1, TWIN_TOKEN, "", NULL, 0, 0)
#define CALL(name) fmi2##name
#define STATE(verb) fmi2##verb##FMUstate
#else
static bool ignored;
static double reached;
#define DO_STEP(c, t, h) fmi3DoStep(c, t, h, 1, &ignored, &ignored, &ignored, &reached)
#define CREATE() fmi3InstantiateCoSimulation("one", TWIN_TOKEN, "", 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL)
#define CALL(name) fmi3##name
#define STATE(verb) fmi3##verb##FMUState
#endif

static double frequency(void *c) {
    const Reference r = REF_OUT + OUT_frequency_Hz;
    double value = 0.0;
    get(c, &r, 1, &value);
    return value;
}

int main(void) {
    void *c = CREATE(), *state = NULL, *read = NULL;
    const Reference temperature = REF_IN, unknown = 77, parameter = REF_PARAMETER;
    const double warm = 30.0;
    static char bytes[sizeof(Instance)];
    if (!c || begin(c) != OK) return 1;
    if (set(c, &parameter, 1, &warm) != ERROR || set(c, &unknown, 1, &warm) != ERROR) return 2;
    if (set(c, &temperature, 1, &warm) != OK) return 3;
    for (int k = 0; k < 50; ++k)
        if (DO_STEP(c, k, 1.0 + k % 7) != OK) return 4;
    if (STATE(Get)(c, &state) != OK) return 5;
    if (DO_STEP(c, 50.0, 2.0) != OK) return 6;
    const double then = frequency(c);
#if TWIN_FMI == 2
    if (fmi2SerializeFMUstate(c, state, bytes, sizeof bytes) || fmi2DeSerializeFMUstate(c, bytes, sizeof bytes, &read)) return 7;
#else
    if (fmi3SerializeFMUState(c, state, (uint8_t *)bytes, sizeof bytes) || fmi3DeserializeFMUState(c, (uint8_t *)bytes, sizeof bytes, &read)) return 7;
#endif
    if (STATE(Set)(c, read) != OK || DO_STEP(c, 50.0, 2.0) != OK) return 8;
    if (frequency(c) != then) return 9;
    if (STATE(Free)(c, &state) || STATE(Free)(c, &read) || state || read) return 10;
    if (CALL(Reset)(c) != OK || begin(c) != OK || DO_STEP(c, 0.0, -1.0) != ERROR) return 11;
    CALL(FreeInstance)(c);
    return 0;
}
