/* white flicker walk offset markov markov_time span runs rows: draws of the twin, one number a line. */
#include <stdio.h>
#include <stdlib.h>

#include "twin.h"

int main(int argc, char **argv) {
    Twin *twin = malloc(sizeof *twin);
    if (argc < 10 || !twin) return 2;
    twin_defaults(twin);
    const TwinLevels level = {atof(argv[1]), atof(argv[2]), atof(argv[3]), atof(argv[4]), atof(argv[5]), atof(argv[6])};
    for (long run = 0; run < atol(argv[8]); ++run) {
        TwinNoise noise = {0};
        for (long n = 0; n < atol(argv[9]); ++n)
            printf("%.12g\n", twin_draw(twin, &noise, level, atof(argv[7])));
    }
    free(twin);
    return 0;
}
