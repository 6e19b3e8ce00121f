//! The scalar type of the dynamics: one number, or several samples side by side.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Arithmetic that the algorithms of this chapter need. Implemented for `f64` (one sample), for [`Lanes`] (eight
/// samples at once) and, where derivatives are needed, for dual numbers.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// The same constant in every lane.
    fn constant(value: f64) -> Self;
    /// Sine and cosine of an angle in rad.
    fn sin_cos(self) -> (Self, Self);
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Exponential function.
    fn exp(self) -> Self;
}

impl Real for f64 {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        sin_cos(self)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        tanh(self)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        exp(self)
    }
}

/// Samples per [`Lanes`]: two AVX2 registers, so that independent operations overlap.
pub const LANES: usize = 8;

/// Eight samples processed side by side. Every operation acts lane by lane and rounds like the
/// same operation on `f64`, so a batch gives the same bits as one sample at a time.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// `y`, eight at a time, filled up with zeros.
    pub fn of(y: &[f64]) -> Vec<Self> {
        let filled = |some: &[f64]| {
            let mut lanes = [0.0; LANES];
            lanes[..some.len()].copy_from_slice(some);
            Self(lanes)
        };
        y.chunks(LANES).map(filled).collect()
    }

    #[inline(always)]
    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = f(out.0[k], other.0[k]);
        }
        out
    }

    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = f(out.0[k]);
        }
        out
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.map2(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.map2(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.map2(other, |a, b| a * b)
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.map(|a| a * factor)
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Real for Lanes {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (mut sin, mut cos) = (self, self);
        for k in 0..LANES {
            (sin.0[k], cos.0[k]) = sin_cos(self.0[k]);
        }
        (sin, cos)
    }

    #[inline(always)]
    fn tanh(self) -> Self {
        self.map(tanh)
    }

    #[inline(always)]
    fn exp(self) -> Self {
        self.map(exp)
    }
}

/// Runs `work` with the widest registers of the machine, chosen at run time.
///
/// Only code that the compiler inlines uses them: `work` and everything it calls should be `#[inline(always)]`. No
/// fused multiply-add is used, so that all machines give the same bits.
#[inline]
pub fn with_widest_registers<R>(work: impl FnMut() -> R) -> R {
    struct Work<F>(F);
    impl<R, F: FnMut() -> R> pulp::WithSimd for Work<F> {
        type Output = R;

        #[inline(always)]
        fn with_simd<S: pulp::Simd>(mut self, _: S) -> R {
            (self.0)()
        }
    }
    pulp::Arch::new().dispatch(Work(work))
}

/// Replaces every `a` by `f(a, b)`, eight at a time. The eight stay in registers if `f` is `#[inline(always)]` and
/// the caller runs in [`with_widest_registers`].
#[inline(always)]
pub fn map_pairs(a: &mut [f64], b: &[f64], f: impl Fn(f64, f64) -> f64) {
    let (a_whole, a_rest) = a.as_chunks_mut::<LANES>();
    let (b_whole, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a_whole.iter_mut().zip(b_whole) {
        // A local buffer, to which nothing inside `f` can refer.
        let mut out = [0.0; LANES];
        for k in 0..LANES {
            out[k] = f(a[k], b[k]);
        }
        *a = out;
    }
    a_rest.iter_mut().zip(b_rest).for_each(|(a, b)| *a = f(*a, *b));
}

/// `f(a, b)` of all pairs, with the widest registers of the machine if `f` is `#[inline(always)]`. `f` is copied
/// because a reference to it would be called and not inlined.
pub fn of_pairs(mut a: Vec<f64>, b: &[f64], f: impl Fn(f64, f64) -> f64 + Copy) -> Vec<f64> {
    with_widest_registers(
        #[inline(always)]
        || map_pairs(&mut a, b, f),
    );
    a
}

/// Adding and subtracting 1.5·2⁵² rounds to the nearest integer and leaves that integer, in two's
/// complement, in the low bits of the sum.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Sine and cosine without branches, so that the compiler can run lanes side by side.
///
/// The angle is reduced by the nearest multiple of π/2, subtracted in three parts whose leading
/// ones carry 33 bits (exact products up to 2²⁰ quarter turns); Taylor-minimax polynomials on
/// [−π/4, π/4] follow. Error below 2 units in the last place for |x| ≤ 10⁶ rad. The mathematical
/// library's own functions differ between platforms; this one gives the same bits everywhere.
#[inline(always)]
#[allow(clippy::excessive_precision, clippy::approx_constant)]
fn sin_cos(x: f64) -> (f64, f64) {
    const PIO2_1: f64 = 1.570_796_326_734_125_614_17;
    const PIO2_2: f64 = 6.077_100_506_303_965_976_6e-11;
    const PIO2_3: f64 = 2.022_266_248_795_950_631_54e-21;
    let shifted = x * std::f64::consts::FRAC_2_PI + ROUND;
    let quarter = shifted.to_bits();
    let k = shifted - ROUND;
    let r = ((x - k * PIO2_1) - k * PIO2_2) - k * PIO2_3;
    let z = r * r;
    let sin_r = r + r
        * z
        * (-1.666_666_666_666_663_243_48e-1
            + z * (8.333_333_333_322_489_461_24e-3
                + z * (-1.984_126_982_985_794_931_34e-4
                    + z * (2.755_731_370_707_006_767_89e-6
                        + z * (-2.505_076_025_340_686_341_95e-8
                            + z * 1.589_690_995_211_550_102_21e-10)))));
    let cos_r = 1.0 - 0.5 * z
        + z * z
            * (4.166_666_666_666_660_190_37e-2
                + z * (-1.388_888_888_887_410_957_49e-3
                    + z * (2.480_158_728_947_672_941_78e-5
                        + z * (-2.755_731_435_139_066_330_35e-7
                            + z * (2.087_572_321_298_174_827_90e-9
                                + z * -1.135_964_755_778_819_482_65e-11)))));
    let odd = quarter & 1 == 1;
    let sin_abs = if odd { cos_r } else { sin_r };
    let cos_abs = if odd { sin_r } else { cos_r };
    // Quadrants 2 and 3 flip the sine, 1 and 2 the cosine: bit 1 of k and of k + 1, moved to the sign.
    let sin_sign = (quarter & 2) << 62;
    let cos_sign = (quarter.wrapping_add(1) & 2) << 62;
    (f64::from_bits(sin_abs.to_bits() ^ sin_sign), f64::from_bits(cos_abs.to_bits() ^ cos_sign))
}

/// Splits exp(y) = 2ᵏ p, |ln p| ≤ ln 2 / 2, and returns 2ᵏ and p − 1, so that small y keep their relative accuracy.
/// |y| ≤ 708 keeps 2ᵏ a normal number.
#[inline(always)]
#[allow(clippy::excessive_precision)]
fn exponential(y: f64) -> (f64, f64) {
    const LN2_HI: f64 = 6.931_471_803_691_238_164_90e-1;
    const LN2_LO: f64 = 1.908_214_929_270_587_700_02e-10;
    let shifted = y * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (y - k * LN2_HI) - k * LN2_LO;
    // Taylor series to r¹³: remainder below 2e-17 relative on |r| ≤ 0.3466.
    let mut tail = 1.0 / 6_227_020_800.0;
    for inverse_factorial in [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
    ] {
        tail = tail * r + inverse_factorial;
    }
    let power = f64::from_bits((shifted.to_bits().wrapping_add(1023)) << 52);
    (power, r + r * r * tail)
}

/// Exponential function without branches. Error below 2 units in the last place for |x| ≤ 708; arguments beyond ±708
/// are replaced by ±708.
#[inline(always)]
fn exp(x: f64) -> f64 {
    let bounded = if x.abs() > 708.0 { 708f64.copysign(x) } else { x };
    let (power, expm1_r) = exponential(bounded);
    power * expm1_r + power
}

/// Hyperbolic tangent without branches: tanh|x| = −e/(2 + e) with e = exp(−2|x|) − 1. Error below 3 units in the last
/// place.
#[inline(always)]
fn tanh(x: f64) -> f64 {
    // Beyond 20 the result rounds to ±1; NaN goes through.
    let (power, expm1_r) = exponential(-2.0 * if x.abs() > 20.0 { 20.0 } else { x.abs() });
    let e = power * expm1_r + (power - 1.0);
    (-e / (2.0 + e)).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ulps(a: f64, b: f64) -> f64 {
        (a - b).abs() / (b.abs().max(f64::MIN_POSITIVE) * f64::EPSILON)
    }

    #[test]
    fn sine_and_cosine_agree_with_the_library_to_rounding() {
        // Near a zero of the function the reduced angle is known only to half a unit of the argument's last reduction
        // step, hence the absolute floor of one unit of 1.
        for k in 0..400_000 {
            let x = (k as f64 - 200_000.0) * 0.000_317 + 1e-9 * k as f64;
            let (s, c) = sin_cos(x);
            assert!((s - x.sin()).abs() <= 2.0 * f64::EPSILON * x.sin().abs().max(0.5), "sin {x}");
            assert!((c - x.cos()).abs() <= 2.0 * f64::EPSILON * x.cos().abs().max(0.5), "cos {x}");
        }
        for x in [0.0, 1e-300, 1e6, -1e6] {
            let (s, c) = sin_cos(x);
            assert!(
                (s - x.sin()).abs() <= 2.0 * f64::EPSILON
                    && (c - x.cos()).abs() <= 2.0 * f64::EPSILON
            );
        }
    }

    #[test]
    fn the_exponential_function_agrees_with_the_library_to_rounding() {
        for k in -60_000..60_000 {
            let x = k as f64 * 0.0118;
            assert!(ulps(exp(x), x.exp()) <= 2.0, "{x}: {} {}", exp(x), x.exp());
        }
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(-1e300) < 1e-307 && exp(f64::INFINITY) > 1e307);
        assert!(exp(f64::NAN).is_nan());
    }

    #[test]
    fn tanh_agrees_with_the_library_to_rounding() {
        for k in -60_000..60_000 {
            let x = k as f64 * 0.000_51;
            assert!(ulps(tanh(x), x.tanh()) <= 3.0 || x == 0.0, "{x}: {} {}", tanh(x), x.tanh());
        }
        for x in [1e-12, 1e-300, 0.0, 150.0, 1e300, -1e300, f64::INFINITY] {
            assert!((tanh(x) - x.tanh()).abs() <= 2.0 * f64::EPSILON * x.tanh().abs(), "{x}");
        }
        assert!(tanh(f64::NAN).is_nan());
    }
}
