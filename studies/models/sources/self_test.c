/* Test: cc -std=c99 -DHRG_SELF_TEST this_file.c -lm && ./a.out; columns: $meaning. */
#ifdef HRG_SELF_TEST
#include <stdio.h>
static const double hrg_rows[][$width] = {
$table
};

static int hrg_differs(const double *row) {
$step
    return !(fabs(found - expected) <= 1e-9 * (1.0 + fabs(expected)));
}

int main(void) {
    int wrong = 0, count = (int)(sizeof hrg_rows / sizeof hrg_rows[0]);
    for (int k = 0; k < count; ++k) wrong += hrg_differs(hrg_rows[k]);
    printf("%d rows, %d differ\n", count, wrong);
    return wrong != 0;
}
#endif
