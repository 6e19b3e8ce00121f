//! Computes what happens between the samples of a repeated motion.

use std::f64::consts::{PI, TAU};

use crate::dot::dot;
use fourier::{Complex64, ComplexToReal, Forward, Inverse};

/// After this many time constants the initial value of a response has decayed below rounding.
const FORGOTTEN: f64 = 37.0;

/// A fine time grid with several ticks per sample over one period, with the Fourier transforms between the two grids.
pub struct FineClock {
    samples: usize,
    ticks: usize,
    forward: Forward,
    inverse: Inverse,
    fine_inverse: Inverse,
    /// iω_h T/(e^{iω_h T} − 1) of every harmonic h.
    of_mean: Vec<Complex64>,
}

impl FineClock {
    /// Creates the grid for periods of `samples` samples, with `ticks` ticks per sample.
    pub fn new(samples: usize, ticks: usize) -> Self {
        let of_mean = |h: usize| {
            let half = PI * h as f64 / samples as f64;
            if h == 0 { Complex64::ONE } else { Complex64::from_polar(half / half.sin(), -half) }
        };
        Self {
            samples,
            ticks,
            forward: fourier::forward(samples),
            inverse: fourier::inverse(samples),
            fine_inverse: fourier::inverse(ticks * samples),
            of_mean: (0..=samples / 2).map(of_mean).collect(),
        }
    }

    /// Samples per period.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Ticks per sample.
    pub fn ticks(&self) -> usize {
        self.ticks
    }

    /// Evaluates one period of `y` at every tick from its Fourier series.
    pub fn refined(&self, y: &[f64]) -> Vec<f64> {
        let mut spectrum = self.spectrum(y);
        if self.samples.is_multiple_of(2) && self.ticks > 1 {
            // The Nyquist harmonic becomes two harmonics of the finer series, which share its amplitude.
            spectrum[self.samples / 2] *= 0.5;
        }
        spectrum.resize(self.ticks * self.samples / 2 + 1, Complex64::ZERO);
        synthesised(&*self.fine_inverse, &mut spectrum)
    }

    /// Evaluates one period of `y` at every tick from its values and rates at the samples.
    ///
    /// A cubic is laid through both between neighbouring samples. Where y bends between two samples, it is closer to
    /// the truth than the Fourier series of y alone.
    pub fn between(&self, y: &[f64], y_per_sample: &[f64]) -> Vec<f64> {
        let (n, ticks) = (self.samples, self.ticks);
        let cell = |k: usize| {
            let (start, end) = (y[k], y[(k + 1) % n]);
            let (rate, rate_at_end) = (y_per_sample[k], y_per_sample[(k + 1) % n]);
            let mean_rate = end - start;
            (0..ticks).map(move |i| {
                let u = i as f64 / ticks as f64;
                let bends = (1.0 - u) * (rate - mean_rate) - u * (rate_at_end - mean_rate);
                start + u * (mean_rate + (1.0 - u) * bends)
            })
        };
        (0..n).flat_map(cell).collect()
    }

    /// Computes the torque that a sampled log shows for the torque `fine_nm`, which is given at every tick.
    ///
    /// Suppose first that no controller reacts to the torque. It accelerates the links, so that q̇ contains −∫τ dt/M,
    /// and the log has this integral at its samples only. Differentiating the Fourier series of these samples up to
    /// harmonic `highest` gives
    ///
    /// τ̃_h = iω_h/(e^{iω_h T} − 1) · DFT_h[∫ τ dt from one sample to the next], with T the time between samples,
    ///
    /// and τ̃ is what recorded torque minus M q̈ shows. τ at the sample instants is another signal: it misses, or
    /// counts too much of, anything that is over within a sample or two (such as a bristle after a reversal).
    ///
    /// A drive reacts to q̇ a little later with the torque ω M q̇, which makes q̇ decay, so that the drive's torque a
    /// obeys ȧ = ω (τ − a), with ω given here as `feedback_per_tick` ([`first_order_lag`]). The log contains samples of
    /// a, and the remainder τ − a as above: together a + (τ − a)˜. For components slower than `highest` the two are
    /// alike; ripple faster than half the sampling rate is aliased to another amplitude and phase.
    pub fn as_logged(&self, fine_nm: &[f64], highest: usize, feedback_per_tick: f64) -> Vec<f64> {
        let cell = LaggedCell::new(self.ticks, feedback_per_tick);
        let (mut rest, gained): (Vec<f64>, Vec<f64>) =
            self.cells(fine_nm).map(|(cell_nm, end_nm)| cell.sums(cell_nm, end_nm)).unzip();
        let given_nm = cell.closed(&gained);
        rest.iter_mut()
            .zip(&given_nm)
            .for_each(|(rest, given)| *rest -= cell.mean_of_start * given);
        let mut logged = self.filtered(&rest, |h| self.of_mean(h, highest));
        logged.iter_mut().zip(&given_nm).for_each(|(nm, given)| *nm += given);
        logged
    }

    /// [`Self::as_logged`] for a drive whose entire reaction is the torque `given_nm`.
    pub fn as_logged_but(&self, fine_nm: &[f64], given_nm: &[f64], highest: usize) -> Vec<f64> {
        let rest: Vec<f64> = fine_nm.iter().zip(given_nm).map(|(nm, given)| nm - given).collect();
        let mut logged = self.unanswered_as_logged(&rest, highest);
        let at_samples = given_nm.iter().step_by(self.ticks);
        logged.iter_mut().zip(at_samples).for_each(|(nm, given)| *nm += given);
        logged
    }

    /// The torques at the ticks of every sample, and the torque at the next sample.
    fn cells<'a>(&self, fine_nm: &'a [f64]) -> impl Iterator<Item = (&'a [f64], f64)> {
        let next = fine_nm[self.ticks..].iter().step_by(self.ticks).chain(&fine_nm[..1]);
        fine_nm.chunks_exact(self.ticks).zip(next.copied())
    }

    /// τ̃ of [`Self::as_logged`].
    fn unanswered_as_logged(&self, fine_nm: &[f64], highest: usize) -> Vec<f64> {
        // Mean over each cell, by the trapezoidal rule.
        let mean: Vec<f64> = self
            .cells(fine_nm)
            .map(|(cell, end)| {
                (cell.iter().sum::<f64>() + 0.5 * (end - cell[0])) / self.ticks as f64
            })
            .collect();
        self.filtered(&mean, |h| self.of_mean(h, highest))
    }

    /// The adjoint of [`Self::as_logged`] without a drive's reaction: returns the w for which Σ y_k τ̃_k = Σ w_k ∫ τ
    /// dt/T, with the integral from sample k to the next.
    pub fn as_logged_adjoint(&self, y: &[f64], highest: usize) -> Vec<f64> {
        self.filtered(y, |h| self.of_mean(h, highest).conj())
    }

    /// The factor iω_h T/(e^{iω_h T} − 1) up to harmonic `highest`, zero beyond.
    fn of_mean(&self, h: usize, highest: usize) -> Complex64 {
        if h > highest { Complex64::ZERO } else { self.of_mean[h] }
    }

    /// Multiplies each harmonic h of one period of `y` by `factor(h)`: ihω gives a derivative, e^(−ihωT) a delay of T.
    pub fn filtered(&self, y: &[f64], factor: impl Fn(usize) -> Complex64) -> Vec<f64> {
        let mut spectrum = self.spectrum(y);
        spectrum.iter_mut().enumerate().for_each(|(h, value)| *value *= factor(h));
        synthesised(&*self.inverse, &mut spectrum)
    }

    /// The time derivative of one period of `y`, sampled at `rate_hz`, from its Fourier series.
    pub fn derivative(&self, y: &[f64], rate_hz: f64) -> Vec<f64> {
        self.derivative_up_to(y, rate_hz, self.samples)
    }

    /// [`Self::derivative`] from the harmonics up to `highest`.
    pub fn derivative_up_to(&self, y: &[f64], rate_hz: f64, highest: usize) -> Vec<f64> {
        let omega = TAU * rate_hz / self.samples as f64;
        let rate = |h: usize| if h > highest { 0.0 } else { h as f64 * omega };
        self.filtered(y, |h| Complex64::new(0.0, rate(h)))
    }

    /// Fourier coefficients of one period, Σ_k y_k e^(−2πihk/n)/n.
    pub fn spectrum(&self, y: &[f64]) -> Vec<Complex64> {
        let mut out = self.forward.make_output_vec();
        self.forward.process(&mut y.to_vec(), &mut out).expect("y has one value per sample");
        let scale = 1.0 / self.samples as f64;
        out.iter_mut().for_each(|c| *c *= scale);
        out
    }
}

/// The lag a of [`first_order_lag`] over one sample, as sums over the torques at its ticks, the end included.
struct LaggedCell {
    /// Weights of the torques in the mean of τ − a from the sample to the next, for a = 0 at the sample.
    rest: Vec<f64>,
    /// Weights of the torques in a at the next sample, for a = 0 at the sample.
    gained: Vec<f64>,
    /// Mean of a over the cell per a at its start, without torque.
    mean_of_start: f64,
    /// The share of a that is left at the next sample, without torque.
    kept: f64,
}

impl LaggedCell {
    fn new(ticks: usize, per_tick: f64) -> Self {
        let keep = (-per_tick).exp();
        // Means by the trapezoidal rule.
        let in_mean = |i: usize| if i == 0 || i == ticks { 0.5 } else { 1.0 } / ticks as f64;
        let of_start: Vec<f64> = (0..=ticks).map(|i| keep.powi(i as i32)).collect();
        let mean_from = |m: usize| (m..=ticks).map(|i| in_mean(i) * of_start[i - m]).sum::<f64>();
        // The step to tick m adds half of (1 − keep)(τ_{m−1} + τ_m).
        let by_steps = |weight: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let step = |m: usize| if (1..=ticks).contains(&m) { weight(m) } else { 0.0 };
            (0..=ticks).map(|i| 0.5 * (1.0 - keep) * (step(i) + step(i + 1))).collect()
        };
        let in_mean_of_lag = by_steps(&mean_from);
        Self {
            rest: in_mean_of_lag.iter().enumerate().map(|(i, lag)| in_mean(i) - lag).collect(),
            gained: by_steps(&|m| of_start[ticks - m]),
            mean_of_start: mean_from(0),
            kept: of_start[ticks],
        }
    }

    /// The mean of τ − a over a cell and a at its end, for a = 0 at its start.
    fn sums(&self, cell_nm: &[f64], end_nm: f64) -> (f64, f64) {
        let sum = |weights: &[f64]| {
            let (last, weights) = weights.split_last().expect("one weight more than ticks");
            dot(weights, cell_nm) + last * end_nm
        };
        (sum(&self.rest), sum(&self.gained))
    }

    /// a at the samples of a period of which every cell adds what it `gained`.
    fn closed(&self, gained: &[f64]) -> Vec<f64> {
        let step = |a: f64, gained: &f64| a * self.kept + gained;
        // All earlier periods contribute (a geometric series). Without feedback, nothing does.
        let forgotten = 1.0 - self.kept.powi(gained.len() as i32);
        let once = gained.iter().fold(0.0, step);
        let mut a = if forgotten > 0.0 { once / forgotten } else { 0.0 };
        let start = |gained: &f64| {
            let start = a;
            a = step(start, gained);
            start
        };
        gained.iter().map(start).collect()
    }
}

/// First-order lag of a periodic torque: the a of ȧ = ω (τ − a) over one period, with ω given as `per_tick`. τ between
/// two ticks is the mean of both. Zero if ω is zero.
pub fn first_order_lag(torque_nm: &[f64], per_tick: f64) -> Vec<f64> {
    let n = torque_nm.len();
    let keep = (-per_tick).exp();
    let before = torque_nm.last().into_iter().chain(torque_nm);
    let taken: Vec<f64> =
        before.zip(torque_nm).map(|(before, nm)| (1.0 - keep) * 0.5 * (before + nm)).collect();
    let run_in = ((FORGOTTEN / per_tick) as usize).min(n);
    let mut a = taken[n - run_in..].iter().fold(0.0, |a, taken| a * keep + taken);
    if run_in == n && keep < 1.0 {
        // If the period is short compared with the time constant, all earlier periods contribute (a geometric series).
        a /= 1.0 - keep.powi(n as i32);
    }
    let lag = |taken: &f64| {
        a = a * keep + taken;
        a
    };
    taken.iter().map(lag).collect()
}

/// Inverse transform of the coefficients. The mean, and the harmonic at half the sampling rate that only an even number
/// of samples has, are real; their imaginary parts do not affect the samples and are removed.
fn synthesised(inverse: &dyn ComplexToReal<f64>, spectrum: &mut [Complex64]) -> Vec<f64> {
    let mut out = inverse.make_output_vec();
    spectrum[0].im = 0.0;
    if out.len().is_multiple_of(2) {
        spectrum[out.len() / 2].im = 0.0;
    }
    inverse.process(spectrum, &mut out).expect("the plan's own lengths, and the ends are real");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 50;
    const TICKS: usize = 16;

    fn wave(samples: usize, harmonic: f64) -> Vec<f64> {
        let phase = |k: usize| TAU * harmonic * k as f64 / samples as f64 + 0.3;
        (0..samples).map(|k| phase(k).sin()).collect()
    }

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).fold(0.0, |d, (a, b)| d.max((a - b).abs()))
    }

    #[test]
    fn a_wave_is_itself_between_its_samples() {
        let fine = FineClock::new(N, TICKS).refined(&wave(N, 7.0));
        assert!(largest_difference(&fine, &wave(TICKS * N, 7.0)) < 1e-13);
    }

    /// A cubic is reproduced from its values and rates; for a sine the relative error is (ω T)⁴/384.
    #[test]
    fn values_and_rates_tell_what_is_between() {
        let (clock, harmonic) = (FineClock::new(N, TICKS), 3.0);
        let omega = TAU * harmonic / N as f64;
        let phase = |k: usize| omega * k as f64 + 0.3;
        let rates: Vec<f64> = (0..N).map(|k| omega * phase(k).cos()).collect();
        let found = clock.between(&wave(N, harmonic), &rates);
        let off = largest_difference(&found, &wave(TICKS * N, harmonic));
        let theory = omega.powi(4) / 384.0;
        assert!(off < theory && off > 0.8 * theory, "{off} {theory}");
    }

    /// With an odd number of samples the highest harmonic is like any other; with an even number and one tick per
    /// sample it is kept unchanged.
    #[test]
    fn the_highest_harmonic_stays() {
        for n in [50, 51] {
            let clock = FineClock::new(n, 1);
            let y: Vec<f64> = (0..n).map(|k| (k * k % 7) as f64).collect();
            assert!(largest_difference(&clock.filtered(&y, |_| Complex64::ONE), &y) < 1e-13);
            assert!(largest_difference(&clock.refined(&y), &y) < 1e-13);
        }
    }

    #[test]
    fn a_wave_is_differentiated() {
        let (clock, rate_hz) = (FineClock::new(N, 1), 25.0);
        let omega = TAU * 7.0 * rate_hz / N as f64;
        let later = clock
            .filtered(&wave(N, 7.0), |h| Complex64::from_polar(omega, TAU / 4.0 * h as f64 / 7.0));
        assert!(largest_difference(&clock.derivative(&wave(N, 7.0), rate_hz), &later) < 1e-11);
    }

    /// A slow sine, integrated between samples and differentiated, is unchanged except for the error of the trapezoidal
    /// rule, (ω Δt)²/12 with Δt one tick.
    #[test]
    fn what_is_slow_is_logged_as_it_is() {
        let clock = FineClock::new(N, TICKS);
        let logged = clock.as_logged(&wave(TICKS * N, 3.0), 20, 0.0);
        let tick = TAU * 3.0 / (TICKS * N) as f64;
        assert!(largest_difference(&logged, &wave(N, 3.0)) < tick * tick / 12.0 + 1e-13);
        assert!(largest_difference(&clock.as_logged(&wave(800, 21.0), 20, 0.0), &[0.0; N]) < 1e-13);
    }

    /// The adjoint weights the means between samples as the log shows them, except for rounding.
    #[test]
    fn weights_of_what_is_logged() {
        let clock = FineClock::new(N, TICKS);
        let (y, fine) = (wave(N, 5.0), wave(TICKS * N, 55.0));
        let logged = clock.as_logged(&fine, 20, 0.0);
        let direct: f64 = y.iter().zip(logged).map(|(y, logged)| y * logged).sum();
        let next = |k: usize| fine[(k + TICKS) % fine.len()];
        let ends = |k: usize| 0.5 * (next(k * TICKS) - fine[k * TICKS]);
        let means = (0..N)
            .map(|k| (fine[k * TICKS..][..TICKS].iter().sum::<f64>() + ends(k)) / TICKS as f64);
        let weighed: f64 =
            clock.as_logged_adjoint(&y, 20).iter().zip(means).map(|(w, mean)| w * mean).sum();
        assert!((direct - weighed).abs() < 1e-12 && direct.abs() > 1e-3, "{direct} {weighed}");
    }

    /// Links of M = 1 under a sinusoidal friction torque τ faster than half the sampling rate, held by a drive with a =
    /// −ω q̇. The equation is q̈ = a − τ; the log has samples of a and of q̇, and shows a minus the derivative of the
    /// latter.
    #[test]
    fn a_wave_that_a_drive_answers_is_logged_as_its_alias() {
        let (clock, harmonic, per_tick) = (FineClock::new(N, TICKS), 31.0, 0.04);
        let (per_sample, omega) = (per_tick * TICKS as f64, TAU * harmonic / N as f64);
        // Response of ȧ = ω (τ − a), per sample.
        let response = per_sample / Complex64::new(per_sample, omega);
        let answer: Vec<f64> = (0..N)
            .map(|k| (Complex64::from_polar(1.0, omega * k as f64 + 0.3) * response).im)
            .collect();
        let velocity: Vec<f64> = answer.iter().map(|a| -a / per_sample).collect();
        let acceleration = clock.derivative(&velocity, 1.0);
        let shown: Vec<f64> = answer.iter().zip(&acceleration).map(|(a, qdd)| a - qdd).collect();
        let fine = wave(TICKS * N, harmonic);
        let logged = clock.as_logged(&fine, 20, per_tick);
        // Linear interpolation between ticks loses (ω Δ)²/12 of a sine in the lag, and as much in the means of the
        // cells.
        let lost = (omega / TICKS as f64).powi(2) / 6.0;
        let off = largest_difference(&logged, &shown);
        assert!(off < lost, "{off} {lost}");
        // Without the reaction of the drive the result is a different sine.
        assert!(largest_difference(&clock.as_logged(&fine, 20, 0.0), &shown) > 10.0 * lost);
    }

    /// A drive damps a swing faster than half the rate by its speed. Of this torque the log shows what the samples of
    /// the speed have beyond the derivative of the samples of the angle.
    #[test]
    fn a_damped_swing_is_logged_by_its_samples() {
        let clock = FineClock::new(N, TICKS);
        let harmonic = 30.0;
        let omega = TAU * harmonic / N as f64;
        let angle = wave(N, harmonic);
        let fine_rate: Vec<f64> =
            (0..TICKS * N).map(|k| omega * (omega * k as f64 / TICKS as f64 + 0.3).cos()).collect();
        let shown = clock.as_logged_but(&vec![0.0; TICKS * N], &fine_rate, 20);
        let derivative = clock.derivative_up_to(&angle, 1.0, 20);
        let expected: Vec<f64> = fine_rate
            .iter()
            .step_by(TICKS)
            .zip(derivative)
            .map(|(rate, known)| rate - known)
            .collect();
        // The mean over a cell by the trapezoidal rule loses (ω Δ)²/12.
        let lost = omega * (omega / TICKS as f64).powi(2) / 12.0;
        assert!(largest_difference(&shown, &expected) < 2.0 * lost);
    }

    /// Slow components are shown unchanged whatever the drive does: the mean over a tick and the sums over a cell lose
    /// (ω Δ)²/12 each.
    #[test]
    fn what_is_slow_is_logged_as_it_is_behind_a_drive() {
        let clock = FineClock::new(N, TICKS);
        let logged = clock.as_logged(&wave(TICKS * N, 3.0), 20, 0.04);
        let tick = TAU * 3.0 / (TICKS * N) as f64;
        assert!(largest_difference(&logged, &wave(N, 3.0)) < tick * tick / 6.0 + 1e-13);
    }

    /// The lag is summed cell by cell. Followed from tick to tick, it is the same, however long its memory.
    #[test]
    fn a_lag_is_summed_as_it_is_followed() {
        let clock = FineClock::new(N, TICKS);
        let corner = |y: &f64| (8.0 * y).tanh();
        let fine: Vec<f64> = wave(TICKS * N, 3.0).iter().map(corner).collect();
        for per_tick in [1e-4, 0.02, 0.5, 50.0] {
            let followed = clock.as_logged_but(&fine, &first_order_lag(&fine, per_tick), 20);
            let summed = clock.as_logged(&fine, 20, per_tick);
            assert!(largest_difference(&summed, &followed) < 1e-12, "{per_tick}");
        }
    }

    /// For a period shorter than the memory of the lag, the result equals that of many repetitions; a constant passes
    /// in full.
    #[test]
    fn short_periods_are_answered_as_many() {
        for per_tick in [1e-3, 0.1, 50.0] {
            let short = first_order_lag(&wave(30, 2.0), per_tick);
            let periods = (FORGOTTEN / per_tick / 30.0).ceil() as usize + 1;
            let long = first_order_lag(&wave(30, 2.0).repeat(periods), per_tick);
            assert!(largest_difference(&short, &long[..30]) < 1e-13, "{per_tick}");
            assert!(largest_difference(&first_order_lag(&[2.0; 30], per_tick), &[2.0; 30]) < 1e-13);
        }
        assert_eq!(first_order_lag(&wave(30, 2.0), 0.0), [0.0; 30]);
    }

    #[test]
    fn a_derivative_ends_where_it_is_told() {
        let clock = FineClock::new(N, TICKS);
        let both: Vec<f64> = wave(N, 3.0).iter().zip(wave(N, 15.0)).map(|(a, b)| a + b).collect();
        let slow = clock.derivative_up_to(&both, 125.0, 10);
        assert!(largest_difference(&slow, &clock.derivative(&wave(N, 3.0), 125.0)) < 1e-10);
    }

    /// A pulse between two samples, which no sample shows, is logged with its full area.
    #[test]
    fn a_pulse_between_samples_is_logged() {
        let clock = FineClock::new(N, TICKS);
        let mut pulse = vec![0.0; TICKS * N];
        pulse[TICKS * 10 + 8] = 1.0;
        let area: f64 = clock.as_logged(&pulse, 20, 0.0).iter().sum();
        assert!((area - 1.0 / TICKS as f64).abs() < 1e-13, "{area}");
    }
}
