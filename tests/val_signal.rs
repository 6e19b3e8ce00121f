//! The `signal` module against SciPy: `tests/golden/signal_scipy.py` writes `signal.json`.

use armid::signal::{PaperDifferentiator, PaperReading, Resampler, Scratch, ZeroPhase};
use serde::Deserialize;

const RATE_HZ: f64 = 125.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Golden {
    #[serde(rename = "scipy")]
    _scipy: String,
    filters: Vec<Filtered>,
    literal: Vec<f64>,
    intended_interior: Vec<f64>,
    resample: Resampled,
}

#[derive(Deserialize)]
struct Filtered {
    order: usize,
    cutoff_hz: f64,
    y: Vec<f64>,
}

#[derive(Deserialize)]
struct Resampled {
    time_s: Vec<f64>,
    slope: Vec<f64>,
    hermite: Vec<f64>,
    monotone: Vec<f64>,
    linear: Vec<f64>,
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("golden/signal.json")).expect("the golden file is valid")
}

/// The generator in `signal_scipy.py`, reproduced bit by bit.
fn series(n: usize) -> Vec<f64> {
    let mut state: u64 = 12345;
    (0..n)
        .map(|k| {
            state = (1_103_515_245 * state + 12345) % (1 << 31);
            (state >> 15) as f64 / 65536.0 + 0.25 * ((k / 50) % 3) as f64
        })
        .collect()
}

fn assert_near(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (k, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= tolerance, "{what}, value {k}: {f} instead of {e}");
    }
}

/// Rounding errors grow with the sharpness of the poles: order 8 at 2 Hz of 125 Hz has denominators 1 + a₁ + a₂ ≈
/// (2πf_c/f_s)² = 0.01, four sections and two passes: 1e-16/0.01⁴ᐟ² times a few.
#[test]
fn zero_phase_butterworth_equals_sosfiltfilt() {
    for case in golden().filters {
        let filter =
            ZeroPhase::with_single_pass_cutoff(case.cutoff_hz, case.order, RATE_HZ).unwrap();
        let mut y = series(400);
        filter.filter_in_place(&mut y, &mut Scratch::default()).unwrap();
        let every_fifth: Vec<f64> = y.into_iter().step_by(5).collect();
        let what = format!("order {} at {} Hz", case.order, case.cutoff_hz);
        assert_near(&every_fifth, &case.y, 1e-11, &what);
    }
}

/// First derivatives reach the gain of the differentiator, a few times 2πf_c; second derivatives its square.
#[test]
fn both_readings_of_the_paper_filter_equal_filtfilt() {
    let golden = golden();
    let x = series(400);
    let apply = |reading| {
        PaperDifferentiator::new(reading, 10.0, RATE_HZ)
            .unwrap()
            .apply(&x, &mut Scratch::default())
            .unwrap()
    };
    assert_near(&apply(PaperReading::Literal), &golden.literal, 1e-9, "literal");
    let intended = apply(PaperReading::Intended);
    assert_near(&intended[2..398], &golden.intended_interior, 1e-11, "intended");
}

#[test]
fn resampling_equals_scipy_interpolators() {
    let golden = golden().resample;
    let y = series(60);
    let grid = Resampler::new(&golden.time_s, 250.0, 1.0).unwrap();
    assert_near(
        &grid.instants().hermite(&y, &golden.slope).unwrap(),
        &golden.hermite,
        1e-13,
        "hermite",
    );
    assert_near(&grid.instants().monotone(&y).unwrap(), &golden.monotone, 1e-13, "monotone");
    assert_near(&grid.instants().linear(&y).unwrap(), &golden.linear, 1e-13, "linear");
}
