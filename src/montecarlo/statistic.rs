//! Statistics that the calibration claims are about.

/// A statistic with a claim about its true value; the claims are in [`super::calibration::claims`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// Coverage of nominal 95 % intervals, mean over the parameters.
    MeanCoverage,
    /// Coverage of nominal 95 % intervals, for each parameter.
    EachCoverage,
    /// Mean error of each parameter in units of its σ.
    Bias,
    /// Empirical over predicted σ, pooled over the parameters.
    PooledRatio,
    /// Empirical over predicted σ, for each parameter.
    EachRatio,
    /// Error of all parameters jointly, in units of their predicted covariance.
    JointRatio,
}

impl Statistic {
    /// Name of the statistic in results, in words.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::MeanCoverage => "coverage of 95 % intervals, mean over parameters",
            Self::EachCoverage => "coverage of 95 % intervals, worst parameter",
            Self::Bias => "bias over σ, worst parameter",
            Self::PooledRatio => "empirical over predicted σ, pooled over parameters",
            Self::EachRatio => "empirical over predicted σ, worst parameter",
            Self::JointRatio => "error over predicted covariance, all parameters together",
        }
    }
}
