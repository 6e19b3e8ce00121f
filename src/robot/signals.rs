//! One number per joint and sample, stored joint by joint.

/// Samples of one quantity (angle, velocity, torque …) for all joints; the owner of the signals states the unit.
///
/// Storage is joint-major: `joint(j)` is one contiguous time series, which is what filters, spectra and the batched
/// regressor read.
#[derive(Debug, PartialEq)]
pub struct JointSignals {
    joints: usize,
    samples: usize,
    data: Vec<f64>,
}

impl Clone for JointSignals {
    fn clone(&self) -> Self {
        Self { joints: self.joints, samples: self.samples, data: self.data.clone() }
    }

    /// Reuses the existing memory: every trial begins with a copy of the same run.
    fn clone_from(&mut self, source: &Self) {
        (self.joints, self.samples) = (source.joints, source.samples);
        self.data.clone_from(&source.data);
    }
}

impl JointSignals {
    /// Zeros for `joints` × `samples`.
    pub fn zeros(joints: usize, samples: usize) -> Self {
        Self { joints, samples, data: vec![0.0; joints * samples] }
    }

    /// Signals with the value `f(joint, sample)` at every joint and sample.
    pub fn from_fn(joints: usize, samples: usize, mut f: impl FnMut(usize, usize) -> f64) -> Self {
        let mut out = Self::zeros(joints, samples);
        for j in 0..joints {
            for (k, value) in out.joint_mut(j).iter_mut().enumerate() {
                *value = f(j, k);
            }
        }
        out
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Number of samples per joint.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Time series of joint `j` (0-based).
    pub fn joint(&self, j: usize) -> &[f64] {
        &self.data[j * self.samples..(j + 1) * self.samples]
    }

    /// Mutable time series of joint `j` (0-based).
    pub fn joint_mut(&mut self, j: usize) -> &mut [f64] {
        &mut self.data[j * self.samples..(j + 1) * self.samples]
    }

    /// Reverses the sign convention of joint `j` (0-based): negates its series.
    pub fn reverse(&mut self, j: usize) {
        self.joint_mut(j).iter_mut().for_each(|value| *value = -*value);
    }

    /// Copies sample `k` of all joints into `out` (length = number of joints).
    pub fn sample_into(&self, k: usize, out: &mut [f64]) {
        for (j, value) in out.iter_mut().enumerate() {
            *value = self.data[j * self.samples + k];
        }
    }

    /// Overwrites sample `k` of all joints.
    pub fn set_sample(&mut self, k: usize, values: &[f64]) {
        for (j, value) in values.iter().enumerate() {
            self.data[j * self.samples + k] = *value;
        }
    }

    /// The samples in `range`, as new signals.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Self {
        self.map_joints(|_, y| y[range.clone()].to_vec())
    }

    /// Signals in which each joint's series is replaced by `f(joint, series)`; all results must have the same length.
    pub fn map_joints(&self, mut f: impl FnMut(usize, &[f64]) -> Vec<f64>) -> Self {
        let mut data = Vec::new();
        let mut samples = 0;
        for j in 0..self.joints {
            let series = f(j, self.joint(j));
            assert!(j == 0 || series.len() == samples, "joints must keep one common length");
            samples = series.len();
            data.extend(series);
        }
        Self { joints: self.joints, samples, data }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_joint_is_reversed() {
        let mut signals = JointSignals::from_fn(2, 2, |j, k| (10 * j + k) as f64);
        signals.reverse(1);
        assert_eq!([0, 1].map(|j| signals.joint(j)), [[0.0, 1.0], [-10.0, -11.0]]);
    }

    #[test]
    fn a_copy_into_signals_of_the_same_size_takes_no_memory() {
        let source = JointSignals::from_fn(2, 3, |j, k| (10 * j + k) as f64);
        let mut copy = JointSignals::zeros(3, 2);
        let memory = copy.data.as_ptr();
        copy.clone_from(&source);
        assert_eq!(copy, source);
        assert_eq!(copy.data.as_ptr(), memory);
    }
}
