//! The best estimate of a repeated motion: periods are averaged, angle and velocity are combined harmonic by harmonic,
//! and the Fourier series is differentiated exactly.
//!
//! With P periods of n samples, ω = 2πf_s/n, and for each period p the Fourier coefficients Q_ph, V_ph = (1/n) Σ_k y_k
//! e^{−2πihk/n} of angle and velocity:
//!
//! 1. The means Q̄_h, V̄_h and the scatter S_h = Σ_p |Y_ph − Ȳ_h|² / (P − 1) are computed; the scatter is pooled over
//!    bands of neighbouring harmonics. S/P is the noise power of a mean coefficient. Rounding that is the same in every
//!    period does not scatter: its power is known ([`PeriodicRecord`]), and P times as much is added to the periods as
//!    noise, with a mean of zero. The means stay as they are, and all that follows from the scatter counts the
//!    rounding.
//! 2. Both channels measure the same series, V_h = ihω Q_h. Weighted by their noise, Q̂_h = Q̄_h + w (V̄_h/ihω − Q̄_h)
//!    with w = S_q / (S_q + S_v/(hω)²) has the variance v_h = w S_v / (P (hω)²). Slow harmonics come from the angle,
//!    fast ones from the velocity. A velocity whose scatter follows that of the angle was computed from it and is no
//!    second measurement: the series is then that of the angle alone.
//! 3. The series contains at least all bands up to the last one whose energy exceeds the noise. In a band of B
//!    harmonics without motion, the ratio of P Σ|Ȳ_h|²/B to ΣS_h/B follows F(2B, 2B(P − 1)) for Gaussian noise of any
//!    smooth spectrum. Angle and velocity are both tested, at a level at which one joint in a hundred keeps a band too
//!    many. The series continues beyond that band as long as its total noise is a negligible fraction of it
//!    (`FREE_NOISE`, for q̈ and, much later, for q̇): a component too weak to be detected band by band (the kink that
//!    friction leaves at a reversal fades as 1/h² in q̇) is not too weak to bias the friction parameters. q̈ ends
//!    earlier, at 0.2 f_s or 25 Hz.
//! 4. The motion on the period's grid is q, q̇ = Σ ihω Q̂_h e^{ihωt}, q̈ = −Σ (hω)² Q̂_h e^{ihωt}.
//!
//! The mean angle is taken from the angle alone; a mean velocity (an offset of its sensor) is not used.

use std::f64::consts::PI;

use fourier::{Complex64, Forward, Inverse};

use super::averaged_motion::{AveragedMotion, HarmonicPower};
use super::error::{SignalError, checked_rate_hz, enough, same};
use super::periodic_record::PeriodicRecord;
use super::spectra::{BAND_HARMONICS, Band, Spectra};
use crate::random::{Channel, TrialStreams};
use crate::robot::JointSignals;

/// Noise in q̈, as a fraction of its mean square, that costs nothing: it attenuates an inertia by about the same
/// fraction, a small part of the σ that any practical record reaches.
const FREE_NOISE: f64 = 1e-4;
/// The same for q̇, where friction is more sensitive: a few mrad/s, compared with the tens of mrad/s over which
/// friction reverses.
const FREE_NOISE_QD: f64 = 1e-5;

/// Transform plans and thresholds for motions of one length; created once and used for every record of that length.
pub struct PeriodicFit {
    samples_per_period: usize,
    periods: usize,
    rate_hz: f64,
    forward: Forward,
    inverse: Inverse,
    bands: Vec<Band>,
}

/// Highest frequency of q̈ as a fraction of the sampling rate. Where friction reverses, q̇ has a kink, whose spectrum
/// falls only as 1/f². Sampled at f_s, the component of q̇ at f contains the alias of the one at f_s − f, whose size is
/// (f/(f_s − f))² of the component itself: a sixteenth at 0.2 f_s. Beyond that, the derivative is not worth keeping.
const ALIAS_FREE: f64 = 0.2;
/// The same for q and q̇. The friction model evaluates q̇ sample by sample: there the aliased part belongs to the value
/// at the sample, and a series that ends at 0.2 f_s would round the kink off by several mrad/s.
pub const SERIES_END: f64 = 0.32;
/// Highest frequency of q̈ at any sampling rate, Hz: an arm is moved at a few hertz. The effect of friction on q̈
/// stands out of the noise of a fast log up to much higher frequencies, but there the noise in q̈, which grows with the
/// square of the frequency, outweighs it.
const ACCELERATION_HZ: f64 = 25.0;

/// Coherence of the scatter of angle and velocity ([`Spectra::coherence`]) from which on the velocity was computed from
/// the angle. Two sensors have 0.04 along four periods, and 0.13 along two.
const COMPUTED: f64 = 0.9;

/// Working memory of [`PeriodicFit::fit`], one per thread.
#[derive(Default)]
pub struct FitScratch {
    time: Vec<f64>,
    fft: Vec<Complex64>,
    q: Spectra,
    qd: Spectra,
    series: Vec<Complex64>,
    derived: Vec<Complex64>,
}

/// Which harmonics of one joint's series are kept.
#[derive(Default)]
struct Kept {
    /// Highest harmonic of q and q̇; 0 for a joint that stands still.
    highest: usize,
    /// The harmonics of q̈.
    acceleration: HarmonicPower,
}

impl PeriodicFit {
    /// Prepares the fit for records of `periods` ≥ 2 periods of `samples_per_period` ≥ 5 samples at `rate_hz`.
    pub fn new(
        samples_per_period: usize,
        periods: usize,
        rate_hz: f64,
    ) -> Result<Self, SignalError> {
        checked_rate_hz(rate_hz)?;
        enough("a Fourier series of one period", samples_per_period, 5)?;
        if periods < 2 {
            let samples = samples_per_period * periods;
            return Err(SignalError::Periods { samples, samples_per_period });
        }
        Ok(Self {
            samples_per_period,
            periods,
            rate_hz,
            forward: fourier::forward(samples_per_period),
            inverse: fourier::inverse(samples_per_period),
            bands: Band::all(harmonics_below(SERIES_END, samples_per_period), periods),
        })
    }

    /// Samples of one period.
    pub fn samples_per_period(&self) -> usize {
        self.samples_per_period
    }

    /// Samples per second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Number of periods that a record must have.
    pub fn periods(&self) -> usize {
        self.periods
    }

    /// Averages the periods of angle and velocity, combines them and differentiates.
    ///
    /// Errors: a length other than P·n, unequal sizes, a value that is not finite.
    pub fn fit(
        &self,
        record: &PeriodicRecord,
        scratch: &mut FitScratch,
    ) -> Result<AveragedMotion, SignalError> {
        let (n, joints) = (self.samples_per_period, record.q_rad().joints());
        self.check_sizes(record)?;
        let mut motion = AveragedMotion {
            q_rad: JointSignals::zeros(joints, n),
            qd_rad_s: JointSignals::zeros(joints, n),
            qdd_rad_s2: JointSignals::zeros(joints, n),
            harmonics: Vec::with_capacity(joints),
            acceleration: Vec::with_capacity(joints),
        };
        for j in 0..joints {
            self.analyse_joint(record, j, scratch)?;
            let Kept { acceleration, .. } = self.combine(scratch);
            let in_qdd = acceleration.noise.len();
            motion.harmonics.push(in_qdd);
            motion.acceleration.push(acceleration);
            let AveragedMotion { q_rad, qd_rad_s, qdd_rad_s2, .. } = &mut motion;
            let out = [q_rad, qd_rad_s, qdd_rad_s2].map(|signals| signals.joint_mut(j));
            self.synthesise_motion(scratch, in_qdd, out);
        }
        Ok(motion)
    }

    /// Returns every period separately: angle, velocity and acceleration (joints × P·n samples). Angle and velocity are
    /// combined as in step 2 with all harmonics up to `share` of the sampling rate, and nothing is averaged.
    ///
    /// The differences between the periods are encoder noise as it appears in the acceleration, and motion that does
    /// not repeat.
    ///
    /// Errors: as for [`Self::fit`].
    pub fn each_period(
        &self,
        record: &PeriodicRecord,
        share: f64,
        scratch: &mut FitScratch,
    ) -> Result<[JointSignals; 3], SignalError> {
        let n = self.samples_per_period;
        let highest = ((share * n as f64) as usize).clamp(1, n / 2);
        self.period_by_period(record, scratch, |_| [highest, highest])
    }

    /// Returns the deviation of every period from the mean of all, in the harmonics that [`Self::fit`] keeps: angle,
    /// velocity and acceleration (joints × P·n samples).
    ///
    /// Divided by √P, each period's deviation is one draw of the error of the averaged motion.
    ///
    /// Errors: as for [`Self::fit`].
    pub fn deviations(
        &self,
        record: &PeriodicRecord,
        scratch: &mut FitScratch,
    ) -> Result<[JointSignals; 3], SignalError> {
        self.period_by_period(record, scratch, |scratch| {
            let Kept { highest, acceleration } = self.combine(scratch);
            scratch.q.subtract_mean();
            scratch.qd.subtract_mean();
            [highest, acceleration.noise.len()]
        })
    }

    /// Computes angle, velocity and acceleration (joints × P·n samples) period by period as in step 2. `prepare` may
    /// first change the spectra of a joint, and returns the highest harmonics to use: for angle and velocity, and for
    /// the acceleration.
    fn period_by_period(
        &self,
        record: &PeriodicRecord,
        scratch: &mut FitScratch,
        prepare: impl Fn(&mut FitScratch) -> [usize; 2],
    ) -> Result<[JointSignals; 3], SignalError> {
        let (n, joints) = (self.samples_per_period, record.q_rad().joints());
        self.check_sizes(record)?;
        let mut out = [(); 3].map(|()| JointSignals::zeros(joints, n * self.periods));
        for j in 0..joints {
            self.analyse_joint(record, j, scratch)?;
            let [in_qd, in_qdd] = prepare(scratch);
            for p in 0..self.periods {
                let FitScratch { q, qd, series, .. } = &mut *scratch;
                self.combine_period(q, qd, p, in_qd, series);
                let period = p * n..(p + 1) * n;
                let out = out.each_mut().map(|signals| &mut signals.joint_mut(j)[period.clone()]);
                self.synthesise_motion(scratch, in_qdd, out);
            }
        }
        Ok(out)
    }

    /// Step 2 for period `p` alone, up to harmonic `highest`, into `series`.
    fn combine_period(
        &self,
        q: &Spectra,
        qd: &Spectra,
        p: usize,
        highest: usize,
        series: &mut Vec<Complex64>,
    ) {
        let bins = self.samples_per_period / 2 + 1;
        let (of_q, of_qd) = (&q.periods[p * bins..], &qd.periods[p * bins..]);
        series.clear();
        series.resize(bins, Complex64::ZERO);
        series[0] = of_q[0];
        for first in (1..=highest).step_by(BAND_HARMONICS) {
            let band = first..=(first + BAND_HARMONICS - 1).min(highest);
            let (noise_q, noise_qd) = (q.noise(&band), qd.noise(&band));
            for h in band {
                let w = self.angular_frequency(h);
                let from_qd = of_qd[h] / Complex64::new(0.0, w);
                series[h] = of_q[h] + (from_qd - of_q[h]) * weight(noise_q, noise_qd, w);
            }
        }
    }

    /// Step 4 for `scratch.series`: q, q̇ and q̈ of one joint and period; q̈ up to harmonic `in_qdd`.
    fn synthesise_motion(
        &self,
        scratch: &mut FitScratch,
        in_qdd: usize,
        [q, qd, qdd]: [&mut [f64]; 3],
    ) {
        self.synthesise(scratch, |_| Complex64::ONE, q);
        self.synthesise(scratch, |w| Complex64::new(0.0, w), qd);
        scratch.series[in_qdd + 1..].fill(Complex64::ZERO);
        self.synthesise(scratch, |w| Complex64::new(-w * w, 0.0), qdd);
    }

    fn check_sizes(&self, record: &PeriodicRecord) -> Result<(), SignalError> {
        let (q_rad, qd_rad_s) = (record.q_rad(), record.qd_rad_s());
        same("samples in whole periods", self.samples_per_period * self.periods, q_rad.samples())?;
        same("samples of angle and velocity", q_rad.samples(), qd_rad_s.samples())?;
        same("joints of angle and velocity", q_rad.joints(), qd_rad_s.joints())
    }

    /// ω of harmonic `h`, rad/s.
    fn angular_frequency(&self, h: usize) -> f64 {
        2.0 * PI * self.rate_hz * h as f64 / self.samples_per_period as f64
    }

    /// Step 1 for both channels of joint `j`.
    fn analyse_joint(
        &self,
        record: &PeriodicRecord,
        j: usize,
        scratch: &mut FitScratch,
    ) -> Result<(), SignalError> {
        check_finite("angle", record.q_rad(), j)?;
        check_finite("velocity", record.qd_rad_s(), j)?;
        let FitScratch { time, fft, q, qd, .. } = scratch;
        let [of_q, of_qd] = record.rounding(j);
        self.transform(record.q_rad().joint(j), time, fft, q);
        q.average(self.samples_per_period, of_q);
        self.transform(record.qd_rad_s().joint(j), time, fft, qd);
        qd.average(self.samples_per_period, of_qd);
        if q.coherence(qd, &self.bands) > COMPUTED {
            qd.silence();
        }
        let streams = TrialStreams::new(0, b"rounding that repeats", 0);
        q.scatter_rounding(streams.stream(Channel::Position, j));
        qd.scatter_rounding(streams.stream(Channel::Velocity, j));
        Ok(())
    }

    /// Coefficients of every period of `y`.
    fn transform(
        &self,
        y: &[f64],
        time: &mut Vec<f64>,
        fft: &mut Vec<Complex64>,
        out: &mut Spectra,
    ) {
        let n = self.samples_per_period;
        let bins = n / 2 + 1;
        let scale = 1.0 / n as f64;
        time.resize(n, 0.0);
        fft.resize(
            self.forward.get_scratch_len().max(self.inverse.get_scratch_len()),
            Complex64::ZERO,
        );
        out.periods.resize(bins * self.periods, Complex64::ZERO);
        for (period, spectrum) in y.chunks_exact(n).zip(out.periods.chunks_exact_mut(bins)) {
            time.copy_from_slice(period);
            self.forward
                .process_with_scratch(time, spectrum, fft)
                .expect("all buffers have the plan's own lengths");
            spectrum.iter_mut().for_each(|c| *c *= scale);
        }
    }

    /// Steps 2 and 3: writes Q̂ into `scratch.series` and returns which harmonics are kept.
    fn combine(&self, scratch: &mut FitScratch) -> Kept {
        let FitScratch { q, qd, series, .. } = scratch;
        let periods = self.periods as f64;
        series.clear();
        series.resize(q.mean.len(), Complex64::ZERO);
        series[0] = q.mean[0];
        let mut kept = Kept::default();
        let Some(last) = self
            .bands
            .iter()
            .rposition(|band| q.stands_out(band, periods) || qd.stands_out(band, periods))
        else {
            return kept;
        };
        // Mean square and noise accumulated so far, of q̇ and of q̈.
        let (mut square, mut noise) = ([0.0; 2], [0.0; 2]);
        let mut in_qdd = true;
        let share = ALIAS_FREE.min(ACCELERATION_HZ / self.rate_hz);
        let last_of_qdd = harmonics_below(share, self.samples_per_period);
        for (b, band) in self.bands.iter().enumerate() {
            let (noise_q, noise_qd) = (q.noise(&band.harmonics), qd.noise(&band.harmonics));
            let weight = |w: f64| weight(noise_q, noise_qd, w);
            let frequencies = band.harmonics.clone().map(|h| (h, self.angular_frequency(h)));
            // Mean square of the noise in q̇ at a harmonic.
            let in_qd = |w: f64| match noise_qd.is_finite() {
                true => 2.0 * weight(w) * noise_qd / periods,
                false => 2.0 * w * w * noise_q / periods,
            };
            let added = frequencies.clone().fold([0.0; 2], |[v, a], (_, w)| {
                let noise = in_qd(w);
                [v + noise, a + w * w * noise]
            });
            if b > last {
                if noise[0] + added[0] > FREE_NOISE_QD * square[0] {
                    break;
                }
                in_qdd &= noise[1] + added[1] <= FREE_NOISE * square[1];
            }
            noise = [noise[0] + added[0], noise[1] + added[1]];
            for (h, w) in frequencies {
                let from_qd = qd.mean[h] / Complex64::new(0.0, w);
                series[h] = q.mean[h] + (from_qd - q.mean[h]) * weight(w);
                let of_qd = 2.0 * w * w * series[h].norm_sqr();
                square = [square[0] + of_qd, square[1] + w * w * of_qd];
                if in_qdd && h <= last_of_qdd {
                    kept.acceleration.estimate.push(w * w * of_qd);
                    kept.acceleration.noise.push(w * w * in_qd(w));
                }
            }
            kept.highest = *band.harmonics.end();
        }
        kept
    }

    /// Step 4: Σ_h factor(hω) Q̂_h e^{ihωt} on the period's grid.
    fn synthesise(
        &self,
        scratch: &mut FitScratch,
        factor: impl Fn(f64) -> Complex64,
        out: &mut [f64],
    ) {
        let FitScratch { fft, series, derived, .. } = scratch;
        derived.clear();
        derived
            .extend(series.iter().enumerate().map(|(h, c)| c * factor(self.angular_frequency(h))));
        derived[0].im = 0.0;
        self.inverse
            .process_with_scratch(derived, out, fft)
            .expect("all buffers have the plan's own lengths and the ends are real");
    }
}

/// Weight of the velocity relative to the angle at the frequency ω, from the noise powers of both.
fn weight(noise_q: f64, noise_qd: f64, w: f64) -> f64 {
    noise_q / (noise_q + noise_qd / (w * w))
}

/// Number of harmonics, of a period of n samples, up to `share` of the sampling rate.
fn harmonics_below(share: f64, samples_per_period: usize) -> usize {
    ((share * samples_per_period as f64) as usize).max(1)
}

fn check_finite(what: &'static str, y: &JointSignals, joint: usize) -> Result<(), SignalError> {
    match y.joint(joint).iter().position(|v| !v.is_finite()) {
        Some(sample) => {
            Err(SignalError::NotFinite { what, joint, sample, value: y.joint(joint)[sample] })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
