//! The size of an error.

/// Rms of the samples that count, Nm.
pub fn rms_where(e: &[f64], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut square, mut count) = (0.0, 0usize);
    for (_, e) in e.iter().enumerate().filter(|(k, _)| counts(*k)) {
        square += e * e;
        count += 1;
    }
    (square / count.max(1) as f64).sqrt()
}
