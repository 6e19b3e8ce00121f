//! Whitening of a periodic motion, whose noise is known from the scatter between periods.

use std::borrow::Cow;

use fourier::Forward;
use nalgebra::Complex;
use rayon::prelude::*;

use super::repeating::RepeatingNoise;
use super::scatter::{FLOOR, Noise, Periods, Scatter};
use super::steps::steps;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::image::{Column, Image};
use crate::diagnose::noise_power::{NoiseKnowledge, Uncertainty, rows_of};
use crate::diagnose::scene::Scene;
use crate::identify::{FrictionDrift, HeldAtRest, Panel, Regression};
use crate::robot::JointSignals;
use crate::signal::pooled_level;

/// Whitened rows per harmonic: √P L⁻¹ Ȳ_k of the mean period and L⁻¹ C_k of P − 1 orthonormal contrasts, where S = L Lᴴ
/// is the N × N noise covariance of one period's Fourier coefficients. Where samples of some periods are missing and
/// filled in from the others, which takes from the scatter and from what the mean gains by P periods, both are
/// corrected for it ([`Prepared::kept`](crate::identify::Prepared::kept)). The degrees of freedom of S stay those of P
/// periods.
///
/// S is estimated from the scatter between periods. The scatter is divided by the trend of every joint's power over
/// frequency ([`noise_trends`]), so that steep noise does not bias it, averaged over neighbouring harmonics, and scaled
/// by M/(M − N) (M complex degrees of freedom, N joints), so that ⟨Yᴴ S⁻¹ Y⟩ is that of the true covariance. Friction
/// that drifts ([`FrictionDrift`]) is not noise: it is removed before, and the scatter that this removal costs is made
/// up for. Torques have been moved to a common motion before, so that S is the noise of torque and acceleration
/// together.
///
/// Sampling adds an error to the acceleration where friction reverses. The velocity has a kink there, whose spectrum
/// falls as 1/f²; at f, the kink's component at f_s − f appears as an alias with the share (f/(f_s − f))². The part of
/// it that is not followed between the samples ([`NOT_FOLLOWED`]) is an error of the equations that is the same in
/// every period, and is added to S.
///
/// A joint that sticks holds any friction in its pauses ([`HeldAtRest`]): there, all signals count as zero, and the scatter
/// is that of the rest of the period, as a share of all its samples as large as without pauses.
///
/// Torques of unknown height around reversals, on single joints ([`PeriodWhitening::with_noise_of_joints`]) or anywhere
/// ([`PeriodWhitening::with_repeating_noise`]), are whitened after L⁻¹.
pub struct PeriodWhitening {
    samples: usize,
    periods: usize,
    joints: usize,
    /// Effective number of periods in the mean, less than `periods` where samples are filled in.
    of_mean: f64,
    forward: Forward,
    /// L⁻¹ per harmonic in use, column-major N × N.
    factors: Vec<Vec<Complex<f64>>>,
    /// Uncertainty of the noise's power, per harmonic.
    unknown: Vec<Uncertainty>,
    /// Joints (0-based) whose mean torque changes from period to period by more than noise, and its standard deviation,
    /// Nm.
    drifting: Vec<(usize, f64)>,
    /// Steps that slow noise makes in one period, per joint, each as high as its standard deviation.
    steps: Vec<Image>,
    stepping: Option<RepeatingNoise>,
    /// For every joint, its rows and the repeating noise in them.
    of_joints: Vec<(Vec<usize>, RepeatingNoise)>,
    repeating: Option<RepeatingNoise>,
    /// Joints that hold friction in their pauses, in which no signal counts.
    held_at_rest: Vec<HeldAtRest>,
}

/// Share of the Coulomb friction whose kink is not followed between samples.
///
/// In the fastest eighth of the harmonics of clean logs with a twentieth of the benchmark's noise, residuals exceed
/// that noise as if a share of 0.01 to 0.4 were left, and 0.9 on joint 2 behind drives that feed half forward; the rms
/// is 0.2. The drives feed 0, 0.5 and 0.9 of friction forward, along both motions of the benchmark.
const NOT_FOLLOWED: f64 = 0.2;
/// Distance, relative to the sampling rate, of the highest harmonic in use from the highest frequency of the periods'
/// own motion. It is small because, at 125 samples a second, half of the signal of narrow play lies between 44 and 58
/// Hz.
const BELOW_HIGHEST: f64 = 0.02;

impl PeriodWhitening {
    /// Whitening from the periods of a log.
    pub fn new(regression: &Regression, scene: &Scene, log: &str) -> Result<Self, DiagnoseError> {
        let mut problem = Cow::Borrowed(&regression.problem);
        for held in &scene.held_at_rest {
            held.leave_out(problem.to_mut());
            held.spread_scatter(problem.to_mut());
        }
        let (n, periods, joints) = (problem.samples, problem.periods, problem.joints());
        let forward = fourier::forward(n);
        let mut whitening = Self {
            samples: n,
            periods,
            joints,
            of_mean: regression.prepared.kept()[0] * periods as f64,
            forward,
            factors: Vec::new(),
            unknown: Vec::new(),
            drifting: Vec::new(),
            steps: Vec::new(),
            stepping: None,
            of_joints: Vec::new(),
            repeating: None,
            held_at_rest: scene.held_at_rest.clone(),
        };
        let used = ((regression.prepared.highest - BELOW_HIGHEST) * n as f64).round() as usize;
        let used = used.min(scene.highest);
        // Beyond `highest`, the torque was not moved to the common motion.
        let last = (used + pooled_level(used)).min(scene.highest);
        let drift = FrictionDrift::beside_mean(&scene.motion.qd_rad_s, periods);
        let without_drift = |(j, panel): (usize, &Panel)| {
            let mut y = panel.y.clone();
            drift.remove(j, &mut y, |_| true);
            (j, y)
        };
        let parts = problem.panels.iter().enumerate().map(without_drift).collect();
        let torque = Column { parts };
        let power: Vec<f64> = problem
            .panels
            .iter()
            .map(|panel| panel.y.iter().map(|y| y * y).sum::<f64>() / panel.y.len() as f64)
            .collect();
        let [_, kept] = regression.prepared.kept();
        let all = Periods {
            torque: &torque,
            drift: &drift,
            samples: n,
            periods,
            kept,
            power: &power,
            last,
        };
        let scatter = Scatter::of(&all, |period| whitening.spectrum(period));
        let corners: Vec<Vec<Complex<f64>>> =
            (0..joints).map(|j| whitening.spectrum(scene.sign.joint(j))).collect();
        // Amplitude of the kinks that friction makes in the velocity, as aliased: the share (f/(f_s − f))² of each
        // coefficient.
        let corner = |j: usize, k: usize| {
            let alias = (k as f64 / (n - k) as f64).powi(2);
            NOT_FOLLOWED * alias * scene.coulomb_nm[j] * corners[j][k].norm()
        };
        for k in 0..=used {
            let Noise { covariance: mut s, unknown, drifting } = scatter.noise(k);
            whitening.unknown.push(unknown);
            whitening.drifting.extend(drifting);
            for (j, power) in power.iter().enumerate() {
                s[(j, j)] += FLOOR * FLOOR * power + periods as f64 * corner(j, k).powi(2);
            }
            let inverse = s.cholesky().and_then(|c| c.l().try_inverse());
            let Some(inverse) = inverse else {
                let frequency_hz = k as f64 * problem.rate_hz / n as f64;
                return Err(DiagnoseError::NoNoise { log: log.to_owned(), frequency_hz });
            };
            whitening.factors.push(inverse.iter().copied().collect());
        }
        whitening.steps = steps(&whitening, &torque);
        whitening.stepping =
            (!whitening.steps.is_empty()).then(|| RepeatingNoise::new(&whitening.steps));
        Ok(whitening)
    }

    /// Treats torques on single joints as additional noise, joint by joint. Each torque repeats in every period; its
    /// height is unknown, with standard deviation one. Only the rows of the joint itself are whitened: the rows of
    /// later joints show the torque merely because their noise is correlated with that of the joint.
    pub fn with_noise_of_joints(&mut self, torques: &[(usize, Vec<Column>)]) {
        let of_joint = |(joint, torques): &(usize, Vec<Column>)| {
            let harmonics = 0..self.factors.len();
            let rows: Vec<usize> =
                harmonics.flat_map(|k| rows_of(self.joints, k, *joint)).collect();
            let image = |torque: &Column| {
                let whole = self.image_in_noise(torque).mean;
                Image { mean: rows.iter().map(|row| whole[*row]).collect(), contrast: Vec::new() }
            };
            let images: Vec<Image> = torques.iter().map(image).collect();
            (rows, RepeatingNoise::new(&images))
        };
        let of_joints: Vec<_> = torques.par_iter().map(of_joint).collect();
        self.of_joints = of_joints;
    }

    /// Treats torques as additional noise that repeats in every period, with heights of standard deviation one.
    pub fn with_repeating_noise<'c>(&mut self, torques: impl Iterator<Item = &'c Column>) {
        // Steps of consecutive periods cancel, so that only the first and the last end are left in the mean: 1/P of one
        // step's variance where noise forgets within a period, 2/P where its memory is as long as one.
        let mut steps = self.steps.clone();
        steps.iter_mut().for_each(|step| step.scale((2.0 / self.periods as f64).sqrt()));
        let images = torques.map(|torque| self.image_in_noise(torque));
        let mut images: Vec<Image> = images.chain(steps).collect();
        self.whiten_joints(&mut images);
        self.repeating = Some(RepeatingNoise::new(&images));
    }

    /// Whitens the means of `images` for the noise of single joints. The map is its own adjoint.
    fn whiten_joints(&self, images: &mut [Image]) {
        for (rows, noise) in &self.of_joints {
            // A column that does not act on the joint is zero in its rows, and stays zero.
            let (mut acting, mut own): (Vec<_>, Vec<_>) = images
                .iter_mut()
                .filter(|image| rows.iter().any(|row| image.mean[*row] != 0.0))
                .map(|image| {
                    let mean = rows.iter().map(|row| image.mean[*row]).collect();
                    (image, Image { mean, contrast: Vec::new() })
                })
                .unzip();
            noise.whiten(&mut own);
            for (image, own) in acting.iter_mut().zip(own) {
                rows.iter().zip(own.mean).for_each(|(row, value)| image.mean[*row] = value);
            }
        }
    }

    /// Samples of a period.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    pub(super) fn periods(&self) -> usize {
        self.periods
    }

    pub(super) fn joints(&self) -> usize {
        self.joints
    }

    /// Joints (0-based) whose mean torque drifts, and by how much, Nm rms.
    pub fn drifting(&self) -> &[(usize, f64)] {
        &self.drifting
    }

    /// Uncertainty of the noise in every row.
    pub fn knowledge(&self) -> NoiseKnowledge {
        NoiseKnowledge::new(self.unknown.clone())
    }

    /// Unitary Fourier coefficients of one period.
    fn spectrum(&self, period: &[f64]) -> Vec<Complex<f64>> {
        let mut time = period.to_vec();
        let mut out = self.forward.make_output_vec();
        // The lengths are those of the plan, so that the transform succeeds.
        let _ = self.forward.process(&mut time, &mut out);
        let scale = 1.0 / (self.samples as f64).sqrt();
        out.iter_mut().for_each(|c| *c *= scale);
        out
    }

    /// Whitened rows of one period's spectra (joint, coefficients), times `scale`.
    fn rows(&self, spectra: &[(usize, Vec<Complex<f64>>)], scale: f64) -> Vec<f64> {
        let n = self.joints;
        let mut out = vec![0.0; n * (2 * self.factors.len() - 1)];
        let (mean, harmonics) = out.split_at_mut(n);
        for (j, spectrum) in spectra {
            // L⁻¹ is zero above its diagonal.
            let own = j * n + j..(j + 1) * n;
            let level = scale * spectrum[0].re;
            let factors = &self.factors[0][own.clone()];
            mean[*j..].iter_mut().zip(factors).for_each(|(row, factor)| *row += factor.re * level);
            let rows = harmonics.chunks_exact_mut(2 * n).zip(&self.factors[1..]);
            for ((rows, factors), value) in rows.zip(&spectrum[1..]) {
                let value = value * (scale * std::f64::consts::SQRT_2);
                let (rows, _) = rows[2 * j..].as_chunks_mut::<2>();
                for ([re, im], factor) in rows.iter_mut().zip(&factors[own.clone()]) {
                    let product = factor * value;
                    *re += product.re;
                    *im += product.im;
                }
            }
        }
        out
    }

    /// Adjoint of [`Self::rows`] and of the whitening of repeating noise, per joint over one period.
    pub(super) fn in_time(&self, rows: &[f64]) -> JointSignals {
        let n = self.samples;
        let mut image = [Image { mean: rows.to_vec(), contrast: Vec::new() }];
        self.repeating.iter().for_each(|noise| noise.whiten(&mut image));
        self.whiten_joints(&mut image);
        let [Image { mean: rows, .. }] = image;
        let inverse = fourier::inverse(n);
        let mut spectra = vec![inverse.make_input_vec(); self.joints];
        let mut row = 0;
        for (k, factor) in self.factors.iter().enumerate() {
            let real = k == 0;
            for i in 0..self.joints {
                let value = if real {
                    Complex::new(rows[row], 0.0)
                } else {
                    Complex::new(rows[row], rows[row + 1]) / std::f64::consts::SQRT_2
                };
                row += if real { 1 } else { 2 };
                for (j, spectrum) in spectra.iter_mut().enumerate().take(i + 1) {
                    spectrum[k] += factor[j * self.joints + i].conj() * value;
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
            // The lengths are those of the plan, so that the transform succeeds.
            let _ = inverse.process(spectrum, out.joint_mut(j));
            out.joint_mut(j).iter_mut().for_each(|v| *v *= scale);
        }
        for held in &self.held_at_rest {
            held.silence(out.joint_mut(held.joint));
        }
        out
    }

    /// See [`super::Whitening::image`].
    pub(super) fn image(&self, column: &Column) -> Image {
        let mut image = [self.image_in_noise(column)];
        self.whiten_what_repeats(&mut image);
        let [image] = image;
        image
    }

    /// See [`super::Whitening::images`].
    pub(super) fn images<'c>(&self, columns: impl Iterator<Item = &'c Column>) -> Vec<Image> {
        let mut images: Vec<Image> = columns.map(|column| self.image_in_noise(column)).collect();
        self.whiten_what_repeats(&mut images);
        images
    }

    /// Whitens `images` for the noise that [`Self::image_in_noise`] leaves.
    fn whiten_what_repeats(&self, images: &mut [Image]) {
        self.whiten_joints(images);
        self.repeating.iter().for_each(|noise| noise.whiten(images));
        let Some(noise) = &self.stepping else { return };
        for image in images {
            let rows = image.mean.len();
            let contrasts = image.contrast.chunks_exact(rows);
            let mut contrasts: Vec<Image> = contrasts
                .map(|contrast| Image { mean: contrast.to_vec(), contrast: Vec::new() })
                .collect();
            noise.whiten(&mut contrasts);
            image.contrast = contrasts.into_iter().flat_map(|contrast| contrast.mean).collect();
        }
    }

    /// The signal `y` of joint `j`, of one period or of all, with zeros in pauses that are left out.
    fn in_motion<'y>(&self, j: usize, y: &'y [f64]) -> Cow<'y, [f64]> {
        let mut y = Cow::Borrowed(y);
        for held in self.held_at_rest.iter().filter(|held| held.joint == j) {
            y.to_mut().chunks_exact_mut(self.samples).for_each(|period| held.silence(period));
        }
        y
    }

    /// [`Self::image`] without whitening for noise that repeats.
    pub(super) fn image_in_noise(&self, column: &Column) -> Image {
        let n = self.samples;
        let repeats = column.parts.iter().all(|(_, y)| y.len() == n);
        let weight = self.of_mean.sqrt();
        let parts: Vec<(usize, Cow<[f64]>)> =
            column.parts.iter().map(|(j, y)| (*j, self.in_motion(*j, y))).collect();
        if repeats {
            let spectra: Vec<_> = parts.iter().map(|(j, y)| (*j, self.spectrum(y))).collect();
            return Image { mean: self.rows(&spectra, weight), contrast: Vec::new() };
        }
        let periods: Vec<Vec<(usize, Vec<Complex<f64>>)>> = (0..self.periods)
            .map(|p| {
                let part = |y: &'_ [f64]| {
                    self.spectrum(if y.len() == n { y } else { &y[p * n..(p + 1) * n] })
                };
                parts.iter().map(|(j, y)| (*j, part(y))).collect()
            })
            .collect();
        // Helmert contrasts: period c against the mean of the periods before it.
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

#[cfg(test)]
impl PeriodWhitening {
    /// Whitening for noise of variance one, independent between harmonics and joints.
    pub(super) fn of_white_noise(samples: usize, periods: usize, joints: usize) -> Self {
        let identity = nalgebra::DMatrix::<Complex<f64>>::identity(joints, joints);
        Self {
            samples,
            periods,
            joints,
            of_mean: periods as f64,
            forward: fourier::forward(samples),
            factors: vec![identity.iter().copied().collect(); samples.div_ceil(2)],
            unknown: Vec::new(),
            drifting: Vec::new(),
            steps: Vec::new(),
            stepping: None,
            of_joints: Vec::new(),
            repeating: None,
            held_at_rest: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along a torque a of a joint, the noise has the variance 1 + |a|². With noise on all joints as well, ⟨W c, r⟩ =
    /// ⟨c, Wᵀ r⟩.
    #[test]
    fn noise_of_joints_is_whitened_and_in_time_is_the_adjoint() {
        const SAMPLES: usize = 40;
        let wave = |joint: usize, harmonic: f64, height: f64| {
            let at = |k: usize| height * (harmonic * k as f64 + joint as f64).sin();
            Column::on(joint, (0..SAMPLES).map(at).collect())
        };
        let mut whitening = PeriodWhitening::of_white_noise(SAMPLES, 3, 2);
        let plain = whitening.image(&wave(1, 0.7, 2.0));
        whitening.with_noise_of_joints(&[(1, vec![wave(1, 0.7, 2.0)])]);
        let square = plain.square();
        let seen = whitening.image(&wave(1, 0.7, 2.0)).square();
        assert!((seen - square / (1.0 + square)).abs() < 1e-12, "{seen}, {square}");
        whitening.with_noise_of_joints(&[(1, vec![wave(1, 0.7, 2.0), wave(1, 1.1, 0.5)])]);
        let elsewhere = wave(0, 0.7, 2.0);
        assert_eq!(whitening.image(&elsewhere), whitening.image_in_noise(&elsewhere));

        let everywhere = wave(0, 0.3, 1.0);
        whitening.with_repeating_noise([&everywhere].into_iter());
        let torque = wave(1, 0.9, 1.0);
        let rows = whitening.image(&wave(1, 0.4, 3.0));
        let in_time = whitening.in_time(&rows.mean);
        let of_time: f64 = torque.parts[0].1.iter().zip(in_time.joint(1)).map(|(a, b)| a * b).sum();
        // `in_time` does not apply the weight √P of the mean over P periods.
        let of_rows = whitening.image(&torque).dot(&rows) / 3f64.sqrt();
        assert!((of_time - of_rows).abs() < 1e-12 * of_rows.abs().max(1.0), "{of_time} {of_rows}");
    }
}
