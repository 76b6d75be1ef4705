/* Call with every temperature reading, $column; the temperature counts as linear between readings. */
typedef struct {
    double target, value;
} hrg_cross_damping_state;

$polynomial

/* Set the state as if temperature_degC had lasted; call with the first reading. Returns the error of $output. */
double hrg_cross_damping_settle(hrg_cross_damping_state *state, double temperature_degC) {
    state->target = $gain * hrg_cross_damping(temperature_degC - ($reference));
    state->value = state->target;
    return state->value;
}

/* Error of $output at this reading, dt_s seconds after the last: subtract it from the output. */
double hrg_cross_damping_step(hrg_cross_damping_state *state, double temperature_degC, double dt_s) {
    double before = state->target, value = state->value, x = $pole * dt_s, rise;
    hrg_cross_damping_settle(state, temperature_degC);
    rise = x > 0.0 ? (state->target - before) * (-expm1(-x) / x) : 0.0;
    state->value = state->target - rise + (value - before) * exp(-x);
    return state->value;
}

