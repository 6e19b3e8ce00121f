//! A motion that can be evaluated at any time.

/// The motion that a controller follows: all joints, defined at every time from 0 to its end.
///
/// Implemented by every kind of excitation; the simulated plant samples it at the controller's rate. The acceleration
/// must be the second derivative of the position; otherwise a computed-torque controller receives a feed-forward torque
/// that does not belong to the motion.
pub trait Reference: Sync {
    /// Number of joints N.
    fn joints(&self) -> usize;

    /// Time at which the motion ends, s.
    fn duration_s(&self) -> f64;

    /// Position (rad), velocity (rad/s) and acceleration (rad/s²) at `t_s` (s), each of length N.
    /// Before 0 and after the end the motion is continued without a jump: at rest where it begins or
    /// ends at rest, periodically where it is periodic.
    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]);
}
