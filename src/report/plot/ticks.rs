//! Round numbers along an axis, and their labels.

use super::canvas::{FONT_PX, text_width_px};

/// A grid line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    /// Position in axis coordinates (the value, or its decimal logarithm).
    pub at: f64,
    /// Text beside the line; empty for a minor line.
    pub label: String,
}

/// The grid of one axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    pub ticks: Vec<Tick>,
    /// Power of ten by which the labels are to be multiplied.
    pub exponent: i32,
}

/// Direction in which labels follow one another; it determines the room that each label needs.
#[derive(Debug, Clone, Copy)]
pub(super) enum Along {
    /// Labels side by side: their width counts.
    Horizontal,
    /// Labels above one another: their height counts.
    Vertical,
}

impl Along {
    fn room_px(self, label: &str) -> f64 {
        match self {
            Along::Horizontal => text_width_px(label, FONT_PX) + 14.0,
            Along::Vertical => 1.6 * FONT_PX,
        }
    }

    /// Smallest distance between grid lines at which a grid of this length does not look crowded.
    fn least_px(self, length_px: f64) -> f64 {
        match self {
            Along::Horizontal => (length_px / 12.0).max(42.0),
            Along::Vertical => (length_px / 9.0).max(22.0),
        }
    }
}

/// Multiples of 1, 2 or 5 × 10ᵏ between `low` and `high`, as many as fit into `length_px` without crowding.
pub(super) fn linear(low: f64, high: f64, length_px: f64, along: Along) -> Ticks {
    let px = length_px / (high - low);
    let least = (along.least_px(length_px) / px).min(high - low);
    let mut decade = 10f64.powf(least.log10().floor());
    loop {
        for step in
            [1.0, 2.0, 5.0].map(|digit| digit * decade).into_iter().filter(|&step| step >= least)
        {
            let ticks = linear_with_step(low, high, step);
            let crowded = ticks.ticks.iter().any(|tick| along.room_px(&tick.label) > step * px);
            // A step beyond the span leaves at most one label, which cannot touch another.
            if !crowded || step > high - low {
                return ticks;
            }
        }
        decade *= 10.0;
    }
}

fn linear_with_step(low: f64, high: f64, step: f64) -> Ticks {
    let exponent = shared_exponent(low.abs().max(high.abs()));
    let unit = 10f64.powi(exponent);
    let decimals = (-(step / unit).log10() - 1e-9).ceil().max(0.0) as usize;
    let first = (low / step - 1e-6).ceil() as i64;
    let last = (high / step + 1e-6).floor() as i64;
    let ticks = (first..=last)
        .map(|k| {
            let at = k as f64 * step;
            Tick { at, label: typographic(&format!("{:.decimals$}", at / unit)) }
        })
        .collect();
    Ticks { ticks, exponent }
}

/// A power of 1000 to factor out of labels that would otherwise be long.
pub(super) fn shared_exponent(largest: f64) -> i32 {
    if (1e-2..1e5).contains(&largest) || largest == 0.0 {
        0
    } else {
        ((largest.log10() / 3.0).floor() * 3.0) as i32
    }
}

/// Powers of ten between the exponents `low` and `high`; where there is room, 2 and 5 are labelled too, and the other
/// digits are minor lines. A range of less than one decade is divided like a linear axis.
pub(super) fn logarithmic(low: f64, high: f64, length_px: f64, along: Along) -> Ticks {
    if high - low < 1.0 {
        let Ticks { mut ticks, exponent } =
            linear(10f64.powf(low), 10f64.powf(high), length_px, along);
        for tick in &mut ticks {
            tick.at = tick.at.log10();
        }
        return Ticks { ticks, exponent };
    }
    let decade_px = length_px / (high - low);
    let label_px = along.room_px("0.001");
    let every = (label_px / decade_px).ceil().max(1.0) as i32;
    let labelled_digits: &[i32] = if decade_px > 2.8 * label_px { &[1, 2, 5] } else { &[1] };
    let minor = decade_px > 40.0;
    let mut ticks = Vec::new();
    for decade in low.floor() as i32..=high.ceil() as i32 {
        for digit in 1..=9 {
            let at = f64::from(decade) + f64::from(digit).log10();
            let inside = at >= low - 1e-9 && at <= high + 1e-9;
            let labelled = labelled_digits.contains(&digit) && decade.rem_euclid(every) == 0;
            if inside && (labelled || minor) {
                let label = if labelled { decade_label(digit, decade) } else { String::new() };
                ticks.push(Tick { at, label });
            }
        }
    }
    Ticks { ticks, exponent: 0 }
}

fn decade_label(digit: i32, decade: i32) -> String {
    if (-3..=3).contains(&decade) {
        let decimals = (-decade).max(0) as usize;
        format!("{:.decimals$}", f64::from(digit) * 10f64.powi(decade))
    } else if digit == 1 {
        power_of_ten(decade)
    } else {
        format!("{digit}·{}", power_of_ten(decade))
    }
}

/// `10ⁿ` with a superscript exponent.
pub(super) fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.to_string();
    let raised = digits.chars().map(|c| match c {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        _ => '⁹',
    });
    "10".chars().chain(raised).collect()
}

/// Replaces the hyphen by a minus sign, and drops it before a zero.
pub(super) fn typographic(number: &str) -> String {
    match number.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => number.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ticks: &Ticks) -> Vec<&str> {
        ticks.ticks.iter().map(|t| t.label.as_str()).collect()
    }

    #[test]
    fn steps_of_a_tenth_are_written_with_one_decimal() {
        let ticks = linear(0.0, 0.5, 330.0, Along::Horizontal);
        assert_eq!(labels(&ticks), ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5"]);
    }

    #[test]
    fn zero_has_no_sign_and_negative_numbers_a_true_minus() {
        let ticks = linear(-0.2, 0.2, 150.0, Along::Horizontal);
        assert_eq!(labels(&ticks), ["−0.2", "0.0", "0.2"]);
    }

    #[test]
    fn small_numbers_share_an_exponent() {
        let ticks = linear(0.0, 4e-5, 280.0, Along::Horizontal);
        assert_eq!(ticks.exponent, -6);
        assert_eq!(labels(&ticks), ["0", "10", "20", "30", "40"]);
    }

    #[test]
    fn large_numbers_share_an_exponent() {
        let ticks = linear(0.0, 2.5e6, 150.0, Along::Horizontal);
        assert_eq!(ticks.exponent, 6);
        assert_eq!(labels(&ticks), ["0", "1", "2"]);
    }

    #[test]
    fn a_small_panel_still_has_three_labels() {
        for half_span in [1.05, 3.7, 9.9, 41.0, 98.0] {
            let ticks = linear(-half_span, half_span, 120.0, Along::Vertical);
            assert!(ticks.ticks.len() >= 3, "{half_span}: {ticks:?}");
        }
    }

    #[test]
    fn less_than_a_decade_has_labels_too() {
        let ticks = logarithmic(0.02, 0.31, 300.0, Along::Horizontal);
        assert_eq!(labels(&ticks), ["1.2", "1.4", "1.6", "1.8", "2.0"]);
    }

    /// Labels are centred and extend half their width to either side. From the fourth range on, the labels are too long
    /// for the smallest step that the grid length allows; only in the last range do they fit, by a tenth of a pixel.
    #[test]
    fn horizontal_labels_never_touch() {
        let assert_apart = |ticks: &[Tick], px: f64| {
            for pair in ticks.windows(2) {
                let half_px = |tick: &Tick| text_width_px(&tick.label, FONT_PX) / 2.0;
                let (needed_px, distance_px) =
                    (half_px(&pair[0]) + half_px(&pair[1]), (pair[1].at - pair[0].at) * px);
                assert!(needed_px < distance_px, "{pair:?}: {needed_px} in {distance_px} px");
            }
        };
        for (low, high, length_px, least) in [
            (1000.123, 1000.124, 150.0, 2),
            (-99_999.0, 99_999.0, 120.0, 1),
            (0.0, 1e-9, 90.0, 2),
            (1000.123, 1000.124, 600.0, 5),
            (12_345.6, 12_345.7, 500.0, 5),
            (-99_999.0, -99_990.0, 450.0, 5),
            (-4321.25, -4321.05, 420.0, 5),
            (-490.0, -488.4, 445.0, 8),
        ] {
            let ticks = linear(low, high, length_px, Along::Horizontal).ticks;
            assert!(ticks.len() >= least, "{ticks:?}");
            assert_apart(&ticks, length_px / (high - low));
        }
        // A decade is as long as three labels, just long enough to label 1, 2 and 5.
        for (low, high) in [(-13.0, -7.0), (-5.5, 0.9)] {
            let length_px = 130.0 * (high - low);
            let mut ticks = logarithmic(low, high, length_px, Along::Horizontal).ticks;
            ticks.retain(|tick| !tick.label.is_empty());
            assert!(ticks.len() >= 18, "{ticks:?}");
            assert_apart(&ticks, 130.0);
        }
    }

    #[test]
    fn decades_are_labelled_and_thinned_out() {
        let few = logarithmic(-3.0, 0.0, 240.0, Along::Horizontal);
        let named: Vec<_> =
            few.ticks.iter().filter(|t| !t.label.is_empty()).map(|t| t.label.as_str()).collect();
        assert_eq!(named, ["0.001", "0.01", "0.1", "1"]);
        let many = logarithmic(-12.0, 12.0, 240.0, Along::Horizontal);
        assert!(many.ticks.len() <= 7, "{many:?}");
    }

    #[test]
    fn exponents_are_raised() {
        assert_eq!(power_of_ten(-12), "10⁻¹²");
    }
}
