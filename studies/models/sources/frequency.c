$polynomial

/* Resonance frequency (Hz) at temperature_degC; valid from $lowest to $highest degC. */
double hrg_frequency(double temperature_degC) {
    return hrg_frequency_about(temperature_degC - ($reference));
}

/* Temperature (degC) at which the resonator has this frequency (Hz); *ok is 0 outside the calibrated range.$turns */
double hrg_temperature(double frequency, int *ok) {
    double low = $low, high = $high;
    double sign = hrg_frequency(high) > hrg_frequency(low) ? 1.0 : -1.0;
    *ok = $has_inverse && sign * (frequency - hrg_frequency(low)) >= 0.0
          && sign * (hrg_frequency(high) - frequency) >= 0.0;
    for (int k = 0; k < 60; ++k) {
        double middle = 0.5 * (low + high);
        if (sign * (hrg_frequency(middle) - frequency) < 0.0) low = middle; else high = middle;
    }
    return 0.5 * (low + high);
}

