//! The equations of a log in which noise is white: where every test is made.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Complex, DMatrix};
use realfft::{RealFftPlanner, RealToComplex};

use super::error::DiagnoseError;
use super::friction_drift::FrictionDrift;
use super::image::{Column, Image};
use super::noise_power::NoiseKnowledge;
use super::scene::Scene;
use crate::identify::{Options, Regression};
use crate::robot::JointSignals;
use crate::signal::{NoisePower, Scratch, ZeroPhase, noise_trend};

/// From torques in time to whitened rows.
pub enum Whitening {
    /// A motion that repeats: noise known from the scatter between periods.
    Periods(PeriodWhitening),
    /// A single run: rows of moving samples, divided by the scatter of the fit's residual.
    Run(RunWhitening),
}

/// Per harmonic, with S the 6 × 6 noise covariance of one period's Fourier coefficients:
/// rows √P L⁻¹ Ȳ_k of the mean period and L⁻¹ C_k of P − 1 orthonormal contrasts, S = L Lᴴ.
///
/// S is the scatter between periods, divided by the trend of every joint's power over frequency so that
/// steep noise does not bend it, averaged over neighbouring harmonics, and scaled by M/(M − N) (M complex
/// degrees of freedom, N joints) so that ⟨Yᴴ S⁻¹ Y⟩ is that of the true covariance. Friction that drifts
/// ([`FrictionDrift`]) is no noise and left out of it. Torques have been
/// moved to a common motion before, so that S is the noise of torque and acceleration together. To it comes
/// what sampling does to the acceleration where friction reverses: the velocity has a kink there, whose
/// spectrum falls as 1/f², and holds at f the share (f/(f_s − f))² of it that belongs to f_s − f. That
/// share of Coulomb's torque is an error of the equations that no period tells from another.
pub struct PeriodWhitening {
    samples: usize,
    periods: usize,
    joints: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    /// L⁻¹ per harmonic that is used, row-major N × N.
    factors: Vec<Vec<Complex<f64>>>,
    /// Relative variance of the noise's power per harmonic and joint.
    unknown: Vec<Vec<f64>>,
}

/// Rows of a single run: the regression's low-pass, then a weight per joint, and only samples in
/// which the joint moves: at rest dry friction may be anything between ±Fc.
pub struct RunWhitening {
    filter: ZeroPhase,
    first_sample: usize,
    every: usize,
    rows: usize,
    /// Every so many rows are tested: behind a low-pass neighbours say the same.
    thin: usize,
    weights: Vec<f64>,
    /// Per joint and row.
    counts: Vec<Vec<bool>>,
    /// Rows per block of time, for tests that allow noise with a memory.
    block_rows: usize,
}

/// Harmonics averaged on each side for one covariance: at least so many, and a quarter of the
/// harmonic's number.
const NEIGHBOURS: usize = 12;
/// A mean torque that scatters with more than this times the power of its neighbours drifts: eight periods of
/// white noise show that once in 300 joints (F(7, 17): seven contrasts, and the trend's own freedom).
const DRIFTS: f64 = 5.0;
/// Noise below this share of a joint's rms torque is not told from the rounding of a model.
const FLOOR: f64 = 1e-4;
/// How far, over the rate, what is used ends below the highest frequency of the periods' own motion. Not far, because half
/// of what narrow play shows in 125 samples a second lies between 44 and 58 Hz.
const BELOW_HIGHEST: f64 = 0.02;
/// Rows kept of a single run, per second and hertz of its low-pass.
const KEPT_RATE: f64 = 4.0;
/// Blocks of a single run.
const BLOCK_S: f64 = 1.0;
/// A joint slower than this, rad/s, for as long as [`REST_S`] stands still.
const REST_RAD_S: f64 = 0.02;
const REST_S: f64 = 0.25;

impl PeriodWhitening {
    /// From the periods of a log.
    pub fn new(regression: &Regression, scene: &Scene, log: &str) -> Result<Self, DiagnoseError> {
        let problem = &regression.problem;
        let (n, periods, joints) = (problem.samples, problem.periods, problem.joints());
        let forward = RealFftPlanner::new().plan_fft_forward(n);
        let mut whitening =
            Self { samples: n, periods, joints, forward, factors: Vec::new(), unknown: Vec::new() };
        let harmonics = n / 2 + 1;
        let used = ((regression.prepared.highest - BELOW_HIGHEST) * n as f64).round() as usize;
        let corners: Vec<Vec<Complex<f64>>> =
            (0..joints).map(|j| whitening.spectrum(scene.sign.joint(j))).collect();
        // Running sums over harmonics of Σ_p D Dᴴ/(P − 1), D the deviation from the mean period.
        let mut scatter = vec![DMatrix::<Complex<f64>>::zeros(joints, joints); harmonics];
        let drift = FrictionDrift::beside_mean(&scene.motion.qd_rad_s, periods);
        let mut spectra: Vec<Vec<Complex<f64>>> = Vec::new();
        for (j, panel) in problem.panels.iter().enumerate() {
            let mut y = panel.y.clone();
            drift.remove(j, &mut y, |_| true);
            spectra.extend(y.chunks_exact(n).map(|period| whitening.spectrum(period)));
        }
        let mut power = vec![0.0; joints];
        for (j, panel) in problem.panels.iter().enumerate() {
            power[j] = panel.y.iter().map(|y| y * y).sum::<f64>() / panel.y.len() as f64;
        }
        for (k, scatter) in scatter.iter_mut().enumerate() {
            for p in 0..periods {
                let deviation = nalgebra::DVector::from_fn(joints, |j, _| {
                    let of = |p: usize| spectra[j * periods + p][k];
                    of(p) - (0..periods).map(of).sum::<Complex<f64>>() / periods as f64
                });
                *scatter += &deviation * deviation.adjoint() / Complex::from((periods - 1) as f64);
            }
        }
        // Beyond it the torque was not moved to the common motion.
        let last = (used + NEIGHBOURS.max(used / 4)).min(scene.highest);
        let trends: Vec<Vec<NoisePower>> = (0..joints)
            .map(|j| {
                let floor = (FLOOR * FLOOR * power[j]).max(f64::MIN_POSITIVE);
                let own: Vec<f64> =
                    scatter.iter().map(|s| s[(j, j)].re.max(1e-6 * floor)).collect();
                noise_trend(&own, periods - 1, last)
            })
            .collect();
        // Per harmonic, the standard deviation that the trend gives every joint.
        let sd: Vec<Vec<f64>> = (0..=last)
            .map(|k| trends.iter().map(|trend| trend[k].value.sqrt()).collect())
            .collect();
        scatter.truncate(last + 1);
        for (scatter, sd) in scatter.iter_mut().zip(&sd) {
            for (i, j) in pairs(joints) {
                scatter[(i, j)] /= sd[i] * sd[j];
            }
        }
        for (k, sd) in sd[..=used].iter().enumerate() {
            let reach = NEIGHBOURS.max(k / 4);
            // The mean torque drifts more than its neighbours: it is left out of their average.
            let range = k.saturating_sub(reach).max(1)..(k + reach + 1).min(scatter.len());
            let count = range.len();
            let mut s = DMatrix::<Complex<f64>>::zeros(joints, joints);
            for scatter in &scatter[range] {
                s += scatter;
            }
            let freedom = (count * (periods - 1)) as f64;
            s *= Complex::from(1.0 / count as f64 * freedom / (freedom - joints as f64).max(1.0));
            if k == 0 || 2 * k == n {
                s.iter_mut().for_each(|v| v.im = 0.0);
            }
            let mut sd = sd.clone();
            let mut unknown: Vec<f64> =
                trends.iter().map(|trend| trend[k].relative_variance + 1.0 / freedom).collect();
            if k == 0 {
                for (j, (sd, unknown)) in sd.iter_mut().zip(&mut unknown).enumerate() {
                    let drift = scatter[0][(j, j)].re / s[(j, j)].re;
                    if drift > DRIFTS {
                        *sd *= drift.sqrt();
                        // A real number per period.
                        *unknown = unknown.max(2.0 / (periods - 1) as f64);
                    }
                }
            }
            whitening.unknown.push(unknown);
            for (i, j) in pairs(joints) {
                s[(i, j)] *= sd[i] * sd[j];
            }
            // f/(f_s − f), squared, of the corners that friction makes in the velocity.
            let alias = (k as f64 / (n - k) as f64).powi(2);
            for (j, power) in power.iter().enumerate() {
                let corner = alias * scene.coulomb_nm[j] * corners[j][k].norm();
                s[(j, j)] += FLOOR * FLOOR * power + periods as f64 * corner * corner;
            }
            let inverse = s.cholesky().and_then(|c| c.l().try_inverse());
            let Some(inverse) = inverse else {
                let frequency_hz = k as f64 * problem.rate_hz / n as f64;
                return Err(DiagnoseError::NoNoise { log: log.to_owned(), frequency_hz });
            };
            whitening.factors.push(inverse.transpose().iter().copied().collect());
        }
        Ok(whitening)
    }

    /// How well the noise of every row is known.
    pub fn knowledge(&self) -> NoiseKnowledge {
        NoiseKnowledge::new(self.unknown.clone())
    }

    /// Unitary Fourier coefficients of one period.
    fn spectrum(&self, period: &[f64]) -> Vec<Complex<f64>> {
        let mut time = period.to_vec();
        let mut out = self.forward.make_output_vec();
        // The lengths are the plan's own, so that the transform succeeds.
        let _ = self.forward.process(&mut time, &mut out);
        let scale = 1.0 / (self.samples as f64).sqrt();
        out.iter_mut().for_each(|c| *c *= scale);
        out
    }

    /// Whitened rows of one period's spectra (joint, coefficients), times `scale`.
    fn rows(&self, spectra: &[(usize, Vec<Complex<f64>>)], scale: f64) -> Vec<f64> {
        let rows = self.samples.min(2 * self.factors.len() - 1);
        let mut out = vec![0.0; self.joints * rows];
        let mut row = 0;
        for (k, factor) in self.factors.iter().enumerate() {
            let real = k == 0 || 2 * k == self.samples;
            for i in 0..self.joints {
                let mut sum = Complex::new(0.0, 0.0);
                for (j, spectrum) in spectra.iter().filter(|(j, _)| *j <= i) {
                    sum += factor[i * self.joints + j] * spectrum[k];
                }
                if real {
                    out[row] = scale * sum.re;
                    row += 1;
                } else {
                    out[row] = scale * std::f64::consts::SQRT_2 * sum.re;
                    out[row + 1] = scale * std::f64::consts::SQRT_2 * sum.im;
                    row += 2;
                }
            }
        }
        out
    }

    /// The adjoint of [`Self::rows`], per joint over one period.
    fn in_time(&self, rows: &[f64]) -> JointSignals {
        let n = self.samples;
        let inverse = RealFftPlanner::new().plan_fft_inverse(n);
        let mut spectra = vec![inverse.make_input_vec(); self.joints];
        let mut row = 0;
        for (k, factor) in self.factors.iter().enumerate() {
            let real = k == 0 || 2 * k == n;
            for i in 0..self.joints {
                let value = if real {
                    Complex::new(rows[row], 0.0)
                } else {
                    Complex::new(rows[row], rows[row + 1]) / std::f64::consts::SQRT_2
                };
                row += if real { 1 } else { 2 };
                for (j, spectrum) in spectra.iter_mut().enumerate().take(i + 1) {
                    spectrum[k] += factor[i * self.joints + j].conj() * value;
                }
            }
        }
        let mut out = JointSignals::zeros(self.joints, n);
        let scale = 1.0 / (n as f64).sqrt();
        for (j, spectrum) in spectra.iter_mut().enumerate() {
            spectrum[0].im = 0.0;
            if n.is_multiple_of(2) {
                spectrum[n / 2].im = 0.0;
            }
            // The lengths are the plan's own, so that the transform succeeds.
            let _ = inverse.process(spectrum, out.joint_mut(j));
            out.joint_mut(j).iter_mut().for_each(|v| *v *= scale);
        }
        out
    }

    fn image(&self, column: &Column) -> Image {
        let n = self.samples;
        let repeats = column.parts.iter().all(|(_, y)| y.len() == n);
        let weight = (self.periods as f64).sqrt();
        if repeats {
            let spectra: Vec<_> =
                column.parts.iter().map(|(j, y)| (*j, self.spectrum(y))).collect();
            return Image { mean: self.rows(&spectra, weight), contrast: Vec::new() };
        }
        let periods: Vec<Vec<(usize, Vec<Complex<f64>>)>> = (0..self.periods)
            .map(|p| {
                let part = |y: &'_ [f64]| {
                    self.spectrum(if y.len() == n { y } else { &y[p * n..(p + 1) * n] })
                };
                column.parts.iter().map(|(j, y)| (*j, part(y))).collect()
            })
            .collect();
        // Helmert's contrasts: period c against the mean of the periods before it.
        let combine = |weights: &[f64]| -> Vec<(usize, Vec<Complex<f64>>)> {
            let mut sum = periods[0].clone();
            for (part, (_, spectrum)) in sum.iter_mut().enumerate() {
                for (k, value) in spectrum.iter_mut().enumerate() {
                    *value = weights.iter().zip(&periods).map(|(w, p)| p[part].1[k] * *w).sum();
                }
            }
            sum
        };
        let mean = self.rows(&combine(&vec![1.0 / self.periods as f64; self.periods]), weight);
        let mut contrast = Vec::with_capacity((self.periods - 1) * mean.len());
        for c in 1..self.periods {
            let scale = 1.0 / ((c * (c + 1)) as f64).sqrt();
            let mut weights = vec![scale; c];
            weights.push(-(c as f64) * scale);
            contrast.extend(self.rows(&combine(&weights), 1.0));
        }
        Image { mean, contrast }
    }
}

/// All (i, j) of a square matrix.
fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |i| (0..n).map(move |j| (i, j)))
}

impl RunWhitening {
    /// From a single run and the standard deviation of its residual per joint, Nm.
    pub fn new(
        regression: &Regression,
        options: &Options,
        sigma_nm: &[f64],
    ) -> Result<Self, DiagnoseError> {
        let rate_hz = regression.prepared.processing.rate_hz;
        let filter = ZeroPhase::new(options.cutoff_hz, options.order, rate_hz)?;
        let rows = regression.problem.samples;
        Ok(Self {
            filter,
            first_sample: regression.first_sample,
            every: regression.every,
            rows,
            thin: ((rate_hz / regression.every as f64 / (KEPT_RATE * options.cutoff_hz)) as usize)
                .max(1),
            weights: sigma_nm.iter().map(|s| 1.0 / s).collect(),
            counts: Self::moving_rows(regression),
            block_rows: ((BLOCK_S * rate_hz / regression.every as f64) as usize).max(1),
        })
    }

    /// Block of time of every row of an image.
    pub fn blocks(&self) -> Vec<usize> {
        let one_joint: Vec<usize> =
            (0..self.rows).step_by(self.thin).map(|r| r / self.block_rows).collect();
        one_joint.repeat(self.weights.len())
    }

    /// Per joint and row of the regression, whether the joint moves.
    pub fn moving_rows(regression: &Regression) -> Vec<Vec<bool>> {
        let motion = &regression.prepared.motion;
        let rest = (REST_S * regression.prepared.processing.rate_hz).ceil() as usize;
        let rows = 0..regression.problem.samples;
        (0..motion.joints())
            .map(|j| {
                let moves = moving(motion.qd_rad_s.joint(j), rest, rest / 4);
                let at = |r: usize| moves[regression.sample(r)];
                rows.clone().map(at).collect()
            })
            .collect()
    }

    /// These rows of the regression count on no joint any more.
    pub fn leave_out(&mut self, rows: &[Range<usize>]) {
        for counts in &mut self.counts {
            rows.iter().for_each(|rows| counts[rows.clone()].fill(false));
        }
    }

    fn filtered(&self, y: &[f64]) -> Vec<f64> {
        let mut filtered = y.to_vec();
        // The run is longer than the filter's memory, or there would be no regression of it.
        let _ = self.filter.filter_in_place(&mut filtered, &mut Scratch::default());
        filtered
            .iter()
            .skip(self.first_sample)
            .step_by(self.every)
            .take(self.rows)
            .copied()
            .collect()
    }

    fn image(&self, column: &Column, is_filtered: bool) -> Image {
        let rows = self.rows.div_ceil(self.thin);
        let mut mean = vec![0.0; rows * self.weights.len()];
        for (j, y) in &column.parts {
            let filtered = if is_filtered { y.clone() } else { self.filtered(y) };
            let out = &mut mean[j * rows..(j + 1) * rows];
            for (k, (out, value)) in
                out.iter_mut().zip(filtered.iter().step_by(self.thin)).enumerate()
            {
                if self.counts[*j][k * self.thin] {
                    *out += self.weights[*j] * value;
                }
            }
        }
        Image { mean, contrast: Vec::new() }
    }
}

/// Samples in which a joint moves: not within a rest of `rest` samples or longer, nor `margin`
/// samples beside one.
fn moving(qd_rad_s: &[f64], rest: usize, margin: usize) -> Vec<bool> {
    let n = qd_rad_s.len();
    let mut moves = vec![true; n];
    let mut start = 0;
    for k in 0..=n {
        if k < n && qd_rad_s[k].abs() < REST_RAD_S {
            continue;
        }
        if k - start >= rest {
            moves[start.saturating_sub(margin)..(k + margin).min(n)].fill(false);
        }
        start = k + 1;
    }
    moves
}

impl Whitening {
    /// Rows of a torque signal given in time.
    pub fn image(&self, column: &Column) -> Image {
        match self {
            Self::Periods(periods) => periods.image(column),
            Self::Run(run) => run.image(column, false),
        }
    }

    /// Rows of a column of the regression, which has been through its filter.
    pub fn regression_image(&self, column: &Column) -> Image {
        match self {
            Self::Periods(periods) => periods.image(column),
            Self::Run(run) => run.image(column, true),
        }
    }

    /// Wᵀr in time: its correlation with a torque signal is that signal's score. `None` for a single run.
    pub fn in_time(&self, rows: &Image) -> Option<JointSignals> {
        match self {
            Self::Periods(periods) => Some(periods.in_time(&rows.mean)),
            Self::Run(_) => None,
        }
    }

    /// Torque in time (n samples) as the regression sees it: filtered and cut for a single run.
    pub fn as_regressed(&self, y: &[f64]) -> Vec<f64> {
        match self {
            Self::Periods(_) => y.to_vec(),
            Self::Run(run) => run.filtered(y),
        }
    }

    /// Whether row `row` of joint `joint` in the regression's time counts (the joint moves).
    pub fn counts(&self, joint: usize, row: usize) -> bool {
        match self {
            Self::Periods(_) => true,
            Self::Run(run) => run.counts[joint][row],
        }
    }
}
