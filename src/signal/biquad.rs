//! A second-order section, and cascades of them run forward and backward.

use super::error::{SignalError, enough};

/// H(z) = (b₀ + b₁z⁻¹ + b₂z⁻²) / (1 + a₁z⁻¹ + a₂z⁻²), run in transposed direct form II.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Biquad {
    /// b₀, b₁, b₂.
    pub b: [f64; 3],
    /// a₁, a₂ (a₀ = 1).
    pub a: [f64; 2],
}

impl Biquad {
    fn dc_gain(&self) -> f64 {
        self.b.iter().sum::<f64>() / (1.0 + self.a[0] + self.a[1])
    }

    /// The state that a constant input of 1 leaves behind after an infinite time.
    fn steady_state(&self) -> [f64; 2] {
        let gain = self.dc_gain();
        [gain - self.b[0], self.b[2] - self.a[1] * gain]
    }

    #[inline(always)]
    fn step(&self, state: &mut [f64; 2], x: f64) -> f64 {
        let y = self.b[0] * x + state[0];
        state[0] = self.b[1] * x - self.a[0] * y + state[1];
        state[1] = self.b[2] * x - self.a[1] * y;
        y
    }
}

/// Working memory of the zero-phase filters, one per thread.
///
/// It grows to the size that the filter needs (a few dozen numbers, independent of the length of the record) and then
/// allocates nothing more.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    state: Vec<[f64; 2]>,
    tail: Vec<f64>,
}

/// A cascade of sections run forward and then backward over an oddly extended record.
///
/// The record is continued at both ends by `pad` samples of its own image, rotated by half a turn about the end point
/// (2x₀ − x_k), and each pass starts from the steady state of its first value, as in SciPy's `sosfiltfilt` and
/// `filtfilt` by default.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TwoPass {
    pub sections: Vec<Biquad>,
    pub pad: usize,
}

impl TwoPass {
    /// Smallest number of samples of a record: the extension mirrors `pad` samples next to the end.
    pub fn least_samples(&self) -> usize {
        self.pad + 1
    }

    /// Filters `x` in place. The extensions are computed on the fly; only the one after the end is stored, because the
    /// backward pass starts in it.
    pub fn run(&self, x: &mut [f64], scratch: &mut Scratch) -> Result<(), SignalError> {
        enough("zero-phase filtering", x.len(), self.least_samples())?;
        let pad = self.pad;
        let (first, last) = (x[0], x[x.len() - 1]);
        let Scratch { state, tail } = scratch;
        tail.clear();
        tail.extend(x.iter().rev().skip(1).take(pad).map(|value| 2.0 * last - value));

        self.start(state, 2.0 * first - x[pad]);
        for k in (1..=pad).rev() {
            self.step(state, 2.0 * first - x[k]);
        }
        for value in x.iter_mut().chain(tail.iter_mut()) {
            *value = self.step(state, *value);
        }

        let behind_the_end = tail.last().copied().unwrap_or(last);
        self.start(state, behind_the_end);
        for value in tail.iter().rev() {
            self.step(state, *value);
        }
        for value in x.iter_mut().rev() {
            *value = self.step(state, *value);
        }
        Ok(())
    }

    fn start(&self, state: &mut Vec<[f64; 2]>, mut level: f64) {
        state.clear();
        for section in &self.sections {
            state.push(section.steady_state().map(|z| z * level));
            level *= section.dc_gain();
        }
    }

    #[inline(always)]
    fn step(&self, state: &mut [[f64; 2]], x: f64) -> f64 {
        self.sections.iter().zip(state).fold(x, |value, (section, z)| section.step(z, value))
    }
}
