/* Rayleigh's frequency of an inextensional spherical shell, harmonic n = $n, from $start to $end degrees.
 *
 * HRG paper, equation $equation; written by `hrg derive --code c`. Rayleigh's mode ignores the conditions at
 * the free edge: $defect.
 */
#include <math.h>

static const double PI = 3.1415926535897932;
static const double BENDING_INTEGRAL = $I;
static const double MASS_INTEGRAL = $J;

/* Frequency in Hz, equation $equation: Young's modulus E (Pa), Poisson ratio nu, density rho (kg/m^3),
 * thickness h and radius R (m). */
double rayleigh_frequency(double E, double nu, double rho, double h, double R)
{
    const double omega_squared = $omega_squared;
    return sqrt(omega_squared) / (2.0 * PI);
}

/* How far the standing wave lags behind the turning shell, per angle turned. */
double rayleigh_bryan_factor(void)
{
    return $K;
}

/* Derivatives of ln(frequency) by ln E, nu, ln rho, ln h, ln R and the rim angle (1/rad), in this order. */
void rayleigh_log_derivatives(double nu, double derivative[6])
{
    derivative[0] = $by_E;
    derivative[1] = $by_nu;
    derivative[2] = $by_rho;
    derivative[3] = $by_h;
    derivative[4] = $by_r;
    derivative[5] = $by_phi_2;
}

/* d ln(frequency)/dT (1/K), equation (15), and its parts from E, nu, rho, h and R, from the slopes of ln E, nu, ln rho,
 * ln h and ln R (1/K). A shell that expands freely by alpha has slopes -3 alpha of ln rho and alpha of ln h and ln R. */
double rayleigh_temperature_coefficient(double nu, const double slope[5], double part[5])
{
    double derivative[6], total = 0.0;
    int k;
    rayleigh_log_derivatives(nu, derivative);
    for (k = 0; k < 5; k++) {
        part[k] = derivative[k] * slope[k];
        total += part[k];
    }
    return total;
}
