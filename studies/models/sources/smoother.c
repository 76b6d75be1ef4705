#define HRG_TAPS $count
static const double hrg_taps[HRG_TAPS] = {
    $taps
};
typedef struct { double past[HRG_TAPS]; int filled; } hrg_smoother;

/* Filtered rate, one sample every $sampling s; set state.filled = 0 before the first. */
double hrg_smooth(hrg_smoother *state, double rate) {
    double sum = 0.0, share = 0.0;
    for (int k = HRG_TAPS - 1; k > 0; --k) state->past[k] = state->filled ? state->past[k - 1] : rate;
    state->past[0] = rate;
    state->filled = 1;
    for (int k = 0; k < HRG_TAPS; ++k) {
        if (isnan(state->past[k])) continue;
        sum += hrg_taps[k] * state->past[k];
        share += hrg_taps[k];
    }
    return isnan(rate) || share <= 0.5 ? rate : sum / share;
}
