//! Numbers for people to read: with as many digits as are meaningful.

/// Text in place of a number that is not finite.
pub const NONE: &str = "—";

/// `value` with `digits` significant digits: `0.01234`, `1234`, `1.23e-7`.
///
/// An exponent is used below 10⁻⁴ and from 10⁶ on.
///
/// ```
/// use armid::number::significant;
/// assert_eq!(significant(0.123456, 3), "0.123");
/// assert_eq!(significant(-1.5e-7, 3), "-1.50e-7");
/// assert_eq!(significant(f64::NAN, 3), "—");
/// ```
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NONE.into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let digits = digits.max(1);
    let magnitude = rounded_magnitude(value, digits);
    if has_exponent(magnitude) {
        format!("{value:.0$e}", digits - 1)
    } else {
        fixed(value, digits as i32 - 1 - magnitude)
    }
}

/// `value` with four significant digits, or with as many as it takes to show `width` with two: an interval from 1829.48
/// to 1829.58 must not read `1829 … 1830`.
///
/// ```
/// use armid::number::resolved;
/// assert_eq!(resolved(1829.4812, 0.1), "1829.48");
/// assert_eq!(resolved(0.0208, 104.0), "0.02080");
/// ```
pub fn resolved(value: f64, width: f64) -> String {
    resolved_from(4, value, width)
}

/// [`resolved`] with at least `least` significant digits, nine at most.
///
/// ```
/// use armid::number::resolved_from;
/// assert_eq!(resolved_from(2, 203.0812, 0.34), "203.08");
/// assert_eq!(resolved_from(2, 203.0812, 104.0), "200");
/// ```
pub fn resolved_from(least: usize, value: f64, width: f64) -> String {
    let digits = 2 + rounded_magnitude(value, 4) - rounded_magnitude(width, 2);
    significant(value, digits.clamp(least.min(9) as i32, 9) as usize)
}

/// `value ± sigma`: sigma with two significant digits, the value rounded to the same decimal place, as in `1.234 ±
/// 0.012` and `(1.23 ± 0.12)e-6`. The rule is that of the GUM (JCGM 100:2008, 7.2.6).
///
/// ```
/// use armid::number::with_sigma;
/// assert_eq!(with_sigma(1.23456, 0.0123), "1.235 ± 0.012");
/// assert_eq!(with_sigma(-4.0e-7, 1.0e-8), "(-4.00 ± 0.10)e-7");
/// ```
pub fn with_sigma(value: f64, sigma: f64) -> String {
    if !value.is_finite() {
        return NONE.into();
    }
    if !sigma.is_finite() {
        return format!("{} ± {NONE}", significant(value, 4));
    }
    let sigma = sigma.abs();
    if sigma == 0.0 {
        return format!("{} ± 0", significant(value, 4));
    }
    let largest = value.abs().max(sigma);
    let magnitude = rounded_magnitude(largest, 2);
    let place = 1 - rounded_magnitude(sigma, 2);
    if has_exponent(magnitude) {
        let unit = 10f64.powi(magnitude);
        let place = place + magnitude;
        format!("({} ± {})e{magnitude}", fixed(value / unit, place), fixed(sigma / unit, place))
    } else {
        format!("{} ± {}", fixed(value, place), fixed(sigma, place))
    }
}

/// A fraction in percent with `digits` significant digits: 0.0712 with two is `7.1 %`.
pub fn percent(fraction: f64, digits: usize) -> String {
    if fraction.is_finite() {
        format!("{} %", significant(100.0 * fraction, digits))
    } else {
        NONE.into()
    }
}

/// A number with an SI prefix on its unit: 2e-5 `rad` with three digits is `20.0 µrad`.
///
/// ```
/// use armid::number::prefixed;
/// assert_eq!(prefixed(0.0153, "Nm", 3), "15.3 mNm");
/// assert_eq!(prefixed(0.9999, "s", 2), "1.0 s");
/// ```
pub fn prefixed(value: f64, unit: &str, digits: usize) -> String {
    const PREFIXES: [(i32, &str); 7] =
        [(-12, "p"), (-9, "n"), (-6, "µ"), (-3, "m"), (0, ""), (3, "k"), (6, "M")];
    if !value.is_finite() {
        return NONE.into();
    }
    if value == 0.0 {
        return format!("0 {unit}");
    }
    let power = rounded_magnitude(value, digits.max(1)).div_euclid(3) * 3;
    match PREFIXES.iter().find(|(of_prefix, _)| *of_prefix == power) {
        Some((_, prefix)) => {
            format!("{} {prefix}{unit}", significant(value / 10f64.powi(power), digits))
        }
        None => format!("{} {unit}", significant(value, digits)),
    }
}

/// A count with its thousands separated by narrow no-break spaces: `10 000`.
pub fn count(number: usize) -> String {
    let digits = number.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3 * '\u{202f}'.len_utf8());
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// Power of ten of the leading digit after rounding to `digits` significant digits.
fn rounded_magnitude(value: f64, digits: usize) -> i32 {
    // The formatter rounds exactly; 0.9996 with three digits is 1.00e0.
    let text = format!("{:.*e}", digits - 1, value.abs());
    text.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

fn has_exponent(magnitude: i32) -> bool {
    !(-4..6).contains(&magnitude)
}

/// `value` rounded to `place` digits after the decimal point; a negative place rounds before the point.
fn fixed(value: f64, place: i32) -> String {
    let rounded = if place < 0 {
        let unit = 10f64.powi(-place);
        format!("{:.0}", (value / unit).round() * unit)
    } else {
        format!("{value:.0$}", place as usize)
    };
    match rounded.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        _ => rounded,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits_survive_rounding_up() {
        assert_eq!(significant(9.9996, 4), "10.00");
        assert_eq!(significant(0.000_999_96, 3), "0.00100");
        assert_eq!(significant(999_999.9, 3), "1.00e6");
        assert_eq!(significant(123_456.0, 2), "120000");
        assert_eq!(significant(0.3 - 0.1 - 0.2, 3), "-2.78e-17");
        assert_eq!(significant(0.0, 3), "0");
    }

    #[test]
    fn the_value_ends_at_the_place_of_its_sigma() {
        assert_eq!(with_sigma(12345.6, 123.0), "12350 ± 120");
        assert_eq!(with_sigma(0.5, 0.0996), "0.50 ± 0.10");
        assert_eq!(with_sigma(0.0, 0.0123), "0.000 ± 0.012");
        assert_eq!(with_sigma(-0.0001, 0.5), "0.00 ± 0.50");
        assert_eq!(with_sigma(3.0e-9, 2.0e-7), "(0.0 ± 2.0)e-7");
        assert_eq!(with_sigma(1.0, 0.0), "1.000 ± 0");
        assert_eq!(with_sigma(1.0, f64::INFINITY), "1.000 ± —");
        assert_eq!(with_sigma(f64::NAN, 1.0), "—");
    }

    #[test]
    fn prefixes_step_by_a_thousand() {
        assert_eq!(prefixed(2e-5, "rad", 3), "20.0 µrad");
        assert_eq!(prefixed(999.96e-6, "rad", 3), "1.00 mrad");
        assert_eq!(prefixed(-12_345.0, "N", 3), "-12.3 kN");
        assert_eq!(prefixed(0.0, "Nm", 3), "0 Nm");
    }

    #[test]
    fn percent_and_count() {
        assert_eq!(percent(0.0712, 2), "7.1 %");
        assert_eq!(percent(f64::NAN, 2), "—");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(count(999), "999");
    }
}
