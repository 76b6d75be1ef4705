/* The input `value` is $column. Samples are averaged over $length s; when a block is complete, its mean and the slope of
   the line through the blocks of the last $window s give the bias, which holds until the next block is complete. The
   rate lags by $late s.$warning A NaN is a missing value; outliers are for the caller to leave out. */
#define HRG_BLOCK_S $exact_length
#define HRG_WINDOW_S $exact_window
#define HRG_LAG_S $lag
#define HRG_PLAY $play
#define HRG_BLOCKS $blocks

typedef struct {
    double start, zero;               /* time and value of the first sample */
    double number, sum_t, sum_x, n;   /* the block that is being filled */
    double time[HRG_BLOCKS], mean[HRG_BLOCKS];
    int blocks;                       /* complete ones that are kept, oldest first */
    double raw, play, bias;
    int started, any, ready;
} hrg_bias_state;

/* Bias ($unit) at a value of the input, its rate per second, and its play. */
double hrg_bias(double value, double rate, double play) {
    double f = value - ($reference), r = rate;
    (void)f;
    (void)r;
    (void)play;
    return $total;
}

/* Call once before the first sample. */
void hrg_bias_reset(hrg_bias_state *s) {
    const hrg_bias_state zero = {0};
    *s = zero;
}

static void hrg_finish_block(hrg_bias_state *s) {
    double t = s->start + s->sum_t / s->n, x = s->zero + s->sum_x / s->n, y = x;
    int last, k;
    if (HRG_LAG_S > 0.0 && s->any) {  /* lag of an input that is linear between the blocks, exactly */
        double before = s->mean[s->blocks - 1], step = (t - s->time[s->blocks - 1]) / HRG_LAG_S;
        double rise = (x - s->raw) * (-expm1(-step) / step);
        y = x - rise + (before - s->raw) * exp(-step);
    }
    s->play = !s->any ? y : fmin(fmax(s->play, y - HRG_PLAY), y + HRG_PLAY);
    s->raw = x;
    s->any = 1;
    if (s->blocks == HRG_BLOCKS) {
        for (k = 1; k < HRG_BLOCKS; ++k) {
            s->time[k - 1] = s->time[k];
            s->mean[k - 1] = s->mean[k];
        }
        s->blocks--;
    }
    s->time[s->blocks] = t;
    s->mean[s->blocks++] = y;
    last = s->blocks - 1;
    for (k = 0; s->time[k] < t - HRG_WINDOW_S - 1e-6; ++k) {}
    s->ready = last - k >= $least && t - s->time[k] >= 0.5 * HRG_WINDOW_S;
    if (s->ready) {
        double n = last - k + 1, mt = 0.0, mx = 0.0, tx = 0.0, tt = 0.0, rate;
        int i;
        for (i = k; i <= last; ++i) {
            mt += (s->time[i] - t) / n;
            mx += (s->mean[i] - y) / n;
        }
        for (i = k; i <= last; ++i) {
            double u = s->time[i] - t - mt;
            tx += u * (s->mean[i] - y - mx);
            tt += u * u;
        }
        rate = tx / tt;
        s->ready = y >= $low && y <= $high && rate >= $r_low && rate <= $r_high;
        s->bias = hrg_bias(y, rate, s->play - y);
    }
}

/* Output with the bias taken out; *ok is 0, and the output is as it was, while the rate is unknown or the input outside
   the calibrated range. time_s increases from call to call. */
double hrg_compensate(hrg_bias_state *s, double time_s, double output, double value, int *ok) {
    if (value == value) {
        double number;
        if (!s->started) {
            s->started = 1;
            s->start = time_s;
            s->zero = value;
        }
        number = floor((time_s - s->start) / HRG_BLOCK_S);
        if (number != s->number && s->n > 0.0) {
            hrg_finish_block(s);
            s->sum_t = s->sum_x = s->n = 0.0;
        }
        s->number = number;
        s->sum_t += time_s - s->start;
        s->sum_x += value - s->zero;
        s->n += 1.0;
    }
    *ok = s->ready && time_s - s->time[s->blocks - 1] <= HRG_WINDOW_S;
    return *ok ? output - s->bias : output;
}

