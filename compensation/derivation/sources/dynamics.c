/* Averaged dynamics of a Coriolis vibratory gyro (Lynch's form); written by `hrg derive --dynamics --code c`.
 *
 * Orbit of half axes a and q (m) at the angle psi = n theta (rad), phase phi (rad) against omega t; first order in
 * 1/(omega tau), Delta_omega/omega, Omega/omega.
 */
#include <math.h>

/* rate[4] = da/dt, dq/dt (m/s), dpsi/dt, dphi/dt (rad/s).
 * Decay time tau (s), damping split Delta_tau = 1/tau_1 - 1/tau_2 (1/s) with its axis psi_tau = n theta_tau, frequency
 * split Delta_omega (rad/s) with psi_omega, harmonic n, Bryan factor k, rate Omega (rad/s), and the forces of the loops
 * per modal mass over 2 omega (m/s). */
void averaged_rates(double a, double q, double psi, double tau, double Delta_tau, double psi_tau, double Delta_omega,
                    double psi_omega, double n, double k, double Omega, double u_a, double u_q, double u_r, double u_phi,
                    double rate[4])
{
$common
    rate[0] = $a;
    rate[1] = $q;
    rate[2] = $psi;
    rate[3] = $phi;
}
