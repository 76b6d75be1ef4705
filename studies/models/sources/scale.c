$functions

/* Compensated rate (deg/s) for the raw $output and the temperature. */
double hrg_rate(double output, double temperature_degC) {
    double rate = $scale * (output - ($null)) - hrg_bias(temperature_degC);
    return hrg_scale_over_rate(rate) * hrg_scale_over_temperature(temperature_degC);
}
$smoother