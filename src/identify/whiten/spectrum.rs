//! Transforms a periodic problem into the frequency domain.

use fourier::{Complex64, Forward, RealToComplex};

use crate::identify::problem::{Domain, Problem};

/// Transforms problems from the time domain into the frequency domain.
#[derive(Default)]
pub struct Spectrum {
    plan: Option<Forward>,
    time: Vec<f64>,
    coefficients: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl Spectrum {
    /// Writes the mean and harmonics 1 … `harmonics` of every column of `problem` into `out` (see
    /// [`Domain::Frequency`]). The harmonics end below half of the sampling rate.
    pub fn transform(&mut self, problem: &Problem, harmonics: usize, out: &mut Problem) {
        let n = problem.samples;
        let harmonics = harmonics.min((n - 1) / 2);
        let plan = match self.plan.take().filter(|plan| plan.len() == n) {
            Some(plan) => plan,
            None => fourier::forward(n),
        };
        self.time.resize(n, 0.0);
        self.coefficients.resize(n / 2 + 1, Complex64::ZERO);
        self.scratch.resize(plan.get_scratch_len(), Complex64::ZERO);
        out.samples = 2 * harmonics + 1;
        out.periods = problem.periods;
        out.rate_hz = problem.rate_hz;
        out.domain = Domain::Frequency;
        for (panel, out) in problem.panels.iter().zip(&mut out.panels) {
            self.columns(&*plan, &panel.x, harmonics, &mut out.x);
            self.columns(&*plan, &panel.y, harmonics, &mut out.y);
        }
        self.plan = Some(plan);
    }

    fn columns(
        &mut self,
        plan: &dyn RealToComplex<f64>,
        columns: &[f64],
        harmonics: usize,
        out: &mut Vec<f64>,
    ) {
        let n = plan.len();
        let one = 1.0 / (n as f64).sqrt();
        let two = std::f64::consts::SQRT_2 * one;
        out.clear();
        for column in columns.chunks_exact(n) {
            self.time.copy_from_slice(column);
            plan.process_with_scratch(&mut self.time, &mut self.coefficients, &mut self.scratch)
                .expect("all buffers have the plan's own lengths");
            out.push(one * self.coefficients[0].re);
            for c in &self.coefficients[1..=harmonics] {
                out.extend([two * c.re, two * c.im]);
            }
        }
    }
}
