//! How a torque is recorded late.

use std::borrow::Cow;

use fourier::Complex64;

use crate::signal::first_order_lag;

/// What lies between the torque and its record. Times are in seconds or in ticks, as the caller's series are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lateness {
    /// A delay; it may be negative.
    Delay(f64),
    /// A low-pass of first order with this positive time constant.
    LowPass(f64),
}

impl Lateness {
    /// The same with times in another unit, `factor` of which make one of the present unit.
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Delay(time) => Self::Delay(factor * time),
            Self::LowPass(time) => Self::LowPass(factor * time),
        }
    }

    /// The time by which slow torques are late.
    pub fn time(self) -> f64 {
        match self {
            Self::Delay(time) | Self::LowPass(time) => time,
        }
    }

    /// Response at the frequency `omega`.
    pub fn response(self, omega: f64) -> Complex64 {
        match self {
            Self::Delay(time) => Complex64::from_polar(1.0, -omega * time),
            Self::LowPass(time) => 1.0 / Complex64::new(1.0, omega * time),
        }
    }

    /// A periodic series, one value per unit of time, behind the low-pass, and the delay that is left to apply to it.
    pub fn parts(self, y: &[f64]) -> (Cow<'_, [f64]>, f64) {
        match self {
            Self::Delay(time) => (y.into(), time),
            Self::LowPass(time) => (first_order_lag(y, 1.0 / time).into(), 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow sine behind either lateness, with the response that belongs to it. A low-pass that takes the mean between
    /// two ticks is late by 1/(12 T) ticks more than T = 7: by 3.7e-4 of the amplitude at ω = 0.0314.
    #[test]
    fn a_series_is_late_as_its_response_says() {
        let omega = std::f64::consts::TAU / 200.0;
        let y: Vec<f64> = (0..400).map(|k| (omega * f64::from(k)).sin()).collect();
        for lateness in [Lateness::Delay(3.0), Lateness::LowPass(7.0)] {
            let (series, delay) = lateness.parts(&y);
            let response = lateness.response(omega) * Complex64::from_polar(1.0, omega * delay);
            let worst = (0..400).map(|k| {
                let expected = (response * Complex64::from_polar(1.0, omega * f64::from(k))).im;
                (series[k as usize] - expected).abs()
            });
            worst.for_each(|off| assert!(off < 4e-4, "{lateness:?}: {off}"));
        }
    }
}
